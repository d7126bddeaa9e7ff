"""The list of jobs, searched and filtered, in a real browser."""

import re

from playwright.sync_api import Locator, Page, expect

from tests.page.conftest import Visit
from tests.support.farms.noise_farm import NoiseFarm


def names(page: Page) -> Locator:
    return page.locator(".job .name")


def test_a_search_looks_at_names_ids_batches_and_tags(visit: Visit, farm: NoiseFarm) -> None:
    # Given three jobs, whose ids are known by their scenes, the oldest first
    made = {
        "frame-10": {"priority": 5, "batch": "dusk"},
        "frame-9": {"priority": 9},
        "lamp": {"requires": ["big-memory"]},
    }
    jobs = {scene: farm.submit(scene, **spec).id for scene, spec in made.items()}
    page = visit().page
    expect(names(page)).to_have_text(["lamp", "frame-9", "frame-10"])
    search = page.get_by_role("searchbox", name="Search the jobs")
    for text, found in (
        ("FRAME", ["frame-9", "frame-10"]),
        ("dusk frame", ["frame-10"]),
        (jobs["frame-9"], ["frame-9"]),
        ("big-mem", ["lamp"]),
    ):
        search.fill(text)
        expect(names(page)).to_have_text(found)
    # It is part of the address, and takes nothing from who types
    expect(page).to_have_url(re.compile(r"\?search=big-mem$"))
    expect(search).to_be_focused()
    page.reload()
    expect(search).to_have_value("big-mem")
    expect(names(page)).to_have_text(["lamp"])
    search.fill("nothing like it")
    expect(page.get_by_text("No job matches")).to_be_visible()
    page.get_by_role("link", name="Show all jobs").click()
    expect(names(page)).to_have_count(3)
    # So are filters
    page.get_by_role("combobox", name="State").select_option("cancelled")
    expect(page).to_have_url(re.compile(r"\?state=cancelled$"))
    expect(page.get_by_text("No job matches")).to_be_visible()
    page.reload()
    expect(page.get_by_role("combobox", name="State")).to_have_value("cancelled")
    page.get_by_role("combobox", name="State").select_option("")
    batch = page.get_by_role("combobox", name="Batch")
    batch.focus()
    batch.select_option("dusk")
    expect(page).to_have_url(re.compile(r"\?batch=dusk$"))
    expect(names(page)).to_have_text(["frame-10"])
    expect(batch).to_be_focused()
    # One comes back to the filter before, and from a job to where one was
    page.go_back()
    expect(names(page)).to_have_count(3)
    page.get_by_role("link", name="frame-9").click()
    expect(page.get_by_role("heading", name="frame-9")).to_be_visible()
    page.go_back()
    expect(page.get_by_role("link", name="frame-9")).to_be_focused()
