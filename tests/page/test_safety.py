"""What a scene or a user says is never more than text, and the page obeys its own policy."""

from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import urlsplit

import httpx
import pytest
from playwright.sync_api import Browser, expect

from plateau.farm.ledger.scene_index import SceneIndex
from plateau.farm.model.states import JobState
from tests.page.conftest import Visit
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.threads import working
from tests.support.until import until

MARKUP = "<img src=x onerror=\"document.title='taken'\"><b>bold</b>"


def test_names_batches_and_reasons_are_text(visit: Visit, farm: NoiseFarm) -> None:
    job = farm.submit(MARKUP, batch=MARKUP[:100], parameters={"a": MARKUP, "b": 1})
    other = farm.submit(MARKUP, batch=MARKUP[:100], parameters={"a": "plain", "b": 1})
    with farm.monitor():
        farm.render(1)
    farm.jobs.cancel(job.id, reason=MARKUP)
    farm.jobs.cancel(other.id, reason=MARKUP)
    visitor = visit(expected={404})  # they were cancelled before their first point
    for path, place in (("/", ".job .why"), (f"/jobs/{job.id}", ".reason")):
        visitor.page.goto(path)
        expect(visitor.page.locator(place).first).to_contain_text(MARKUP)
        expect(visitor.page.locator("main")).to_contain_text(MARKUP)
        expect(visitor.page.locator("main b", has_text="bold")).to_have_count(0)
        assert "taken" not in visitor.page.title().replace(MARKUP, "")
    # So is the name of a scene
    about = {"name": MARKUP, "bytes": 1, "width": 1, "height": 1}
    SceneIndex(farm.jobs._redis).remember("ab" * 32, about)
    page = visitor.page
    page.goto("/submit")
    expect(page.get_by_label("A stored scene").locator("option").last).to_contain_text(MARKUP)


def test_every_file_comes_with_its_policy_and_nothing_else_is_served(url: str) -> None:
    for path in ("/", "/submit", "/workers", "/jobs/0123456789ab", "/page/main.js"):
        answer = httpx.get(url + path, trust_env=False, timeout=60)
        policy = dict(
            directive.split(" ", 1)
            for directive in answer.headers["content-security-policy"].split("; ")
        )
        assert policy["default-src"] == "'none'"
        assert policy["script-src"] == policy["style-src"] == policy["connect-src"] == "'self'"
        assert policy["require-trusted-types-for"] == "'script'"
        assert "unsafe" not in answer.headers["content-security-policy"]
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"
    # They are asked for again and not sent again
    assert answer.headers["cache-control"] == "no-cache"
    headers = {"If-None-Match": answer.headers["etag"]}
    assert httpx.get(url + path, headers=headers, trust_env=False, timeout=60).status_code == 304
    for path in ("/page/none.js", "/page/../routes_page.py", "/page/%2e%2e/app.py"):
        answer = httpx.get(url + path, trust_env=False, timeout=60)
        assert answer.status_code == 404
        assert answer.headers["content-type"] == "application/problem+json"


def test_a_page_that_breaks_its_policy_would_be_noticed(visit: Visit) -> None:
    visitor = visit()
    visitor.page.evaluate(
        "() => { const image = document.createElement('img'); image.src = 'data:,';"
        " document.body.append(image); }"
    )
    until(lambda: visitor.page.wait_for_timeout(50) or visitor._wrong)
    with pytest.raises(AssertionError, match="img-src"):
        visitor.leave()
    visitor.forgive()


def test_states_are_all_told_apart(visit: Visit) -> None:
    """Each state has words of its own in the page's filter, as the farm knows them."""
    page = visit().page
    options = page.get_by_role("combobox", name="State").locator("option")
    values = [option.get_attribute("value") for option in options.all()]
    assert sorted(values[1:]) == sorted(state.value for state in JobState)
    texts = options.all_inner_texts()
    assert len(set(texts)) == len(texts)


@contextmanager
def another_site(text: str) -> Iterator[str]:
    """The URL of a page with this text; its name is not that of our page, so it is another site."""

    class Page(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(text.encode())

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Page)
    with server, working(server.serve_forever, server.shutdown):
        yield f"http://localhost:{server.server_port}/"


def test_a_page_of_another_site_may_link_to_ours_and_has_nothing_of_the_farm(
    browser: Browser, url: str, farm: NoiseFarm
) -> None:
    job = farm.submit("box")
    asked = f"{url}/v1/jobs/{job.id}"
    # Given a page of another site, which asks the API in every way that it can
    elsewhere = f"""<!doctype html><title>elsewhere</title>
      <a id="ours" href="{url}/jobs/{job.id}">ours</a> <a id="link" href="{asked}/log">log</a>
      <form method="post" action="{asked}/cancel"></form>
      <iframe src="{asked}/slices"></iframe>"""
    with another_site(elsewhere) as site, browser.new_context() as context:
        page = context.new_page()
        statuses: dict[str, int] = {}
        page.on("response", lambda one: statuses.setdefault(urlsplit(one.url).path, one.status))
        # If somebody opens it, and it follows its link and sends its form
        page.goto(site)
        fetch = "(url) => fetch(url, {mode: 'no-cors'}).then(() => 'had', () => 'had not')"
        assert page.evaluate(fetch, f"{asked}/curve") == "had not"
        assert page.evaluate(fetch, f"{url}/page/icon.svg") == "had not"
        page.click("#link")
        page.goto(site)
        with page.expect_navigation(url=f"{asked}/cancel"):
            page.evaluate("() => document.forms[0].submit()")
        # Then the API refuses all of that
        parts = ("slices", "log", "cancel")
        assert {part: statuses[f"/v1/jobs/{job.id}/{part}"] for part in parts} == dict.fromkeys(
            parts, 403
        )
        assert farm.jobs.get(job.id).state is JobState.QUEUED
        # But who follows its link to our page is shown the job
        page.goto(site)
        page.click("#ours")
        expect(page.locator("main")).to_contain_text("The curve begins at its first step")


@pytest.mark.long
def test_calls_are_shown_and_can_be_tried(visit: Visit) -> None:
    page = visit("/docs").page
    expect(page.get_by_role("heading", name="Plateau")).to_be_visible()
    page.get_by_role("button", name="GET /healthz").first.click()
    page.get_by_role("button", name="Try it out").click()
    page.get_by_role("button", name="Execute").click()
    expect(page.locator(".live-responses-table")).to_contain_text('"status": "ok"')
