"""The API's own page: from this machine alone, and calls can be tried on it."""

import pytest
from playwright.sync_api import expect

from tests.page.conftest import Visit


@pytest.mark.long
def test_calls_are_shown_and_can_be_tried(visit: Visit) -> None:
    page = visit("/docs").page
    expect(page.get_by_role("heading", name="Plateau")).to_be_visible()
    page.get_by_role("button", name="GET /healthz").first.click()
    page.get_by_role("button", name="Try it out").click()
    page.get_by_role("button", name="Execute").click()
    expect(page.locator(".live-responses-table")).to_contain_text('"status": "ok"')
