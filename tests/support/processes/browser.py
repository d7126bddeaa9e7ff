"""A real Chromium that looks at the web page, and notes everything that goes wrong in it."""

import os
import re
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib import resources
from typing import Any

from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

from tests.support.missing import missing

#: Machines that run the tests of others beside ours are slow.
_PATIENCE_MS = 60_000
expect.set_options(timeout=_PATIENCE_MS)

#: What the console says of every answer that is no success.
_FAILED_ANSWER = re.compile(r"the server responded with a status of (\d{3})")
#: So that a page that breaks its own policy says so where a test sees it.
_TELL_VIOLATIONS = """
document.addEventListener("securitypolicyviolation", (event) =>
  console.error(`policy: ${event.violatedDirective} ${event.blockedURI} ${event.sample}`));
"""

_AXE = (resources.files("axe_playwright_python") / "axe.min.js").read_text("utf-8")
#: WCAG 2.2, level AA, and what is good practice beside it.
_RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]
_RUN_AXE = """
rules => axe.run({runOnly: rules, resultTypes: ["violations"]})
  .then(found => [found.violations, found.passes.length])
"""


@contextmanager
def chromium() -> Iterator[Browser]:
    """Chromium; without one the test skips, and fails in CI."""
    names = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
    path = next(filter(None, map(shutil.which, names)), None)
    if path is None:
        missing("the web page is tested in Chromium (Debian: apt install chromium)")
    with sync_playwright() as playwright:
        # Its sandbox does not run as root.
        arguments = ["--no-sandbox"] if os.geteuid() == 0 else []
        browser = playwright.chromium.launch(
            executable_path=path, args=arguments, timeout=_PATIENCE_MS
        )
        yield browser
        browser.close()


class SharedChromium:
    """Chromium for many, started when the first of them asks, and again after it was closed."""

    def __init__(self) -> None:
        self._over = ExitStack()
        self._browser: Browser | None = None

    def browser(self) -> Browser:
        if self._browser is None:
            self._browser = self._over.enter_context(chromium())
        return self._browser

    def close(self) -> None:
        self._browser = None
        self._over.close()


class Visitor:
    """Somebody who looks at the page with a browser of their own.

    Parameters
    ----------
    browser, url
        The browser and where the page is.
    options
        As `playwright.sync_api.Browser.new_context` takes them.
    """

    def __init__(self, browser: Browser, url: str, **options: Any) -> None:
        self.url = url
        self.context: BrowserContext = browser.new_context(base_url=url, **options)
        self.page: Page = self.context.new_page()
        self.context.set_default_timeout(_PATIENCE_MS)
        self.page.add_init_script(_TELL_VIOLATIONS)
        #: Statuses that a test expects the API to answer.
        self.expected: set[int] = set()
        self._wrong: list[str] = []
        self.page.on("pageerror", lambda error: self._wrong.append(str(error)))
        self.page.on("console", lambda message: self._note(message.type, message.text))
        self.page.on("request", lambda request: self._check_origin(request.url))

    def _note(self, kind: str, text: str) -> None:
        answer = _FAILED_ANSWER.search(text)
        if kind in {"error", "warning"} and not (answer and int(answer[1]) in self.expected):
            self._wrong.append(text)

    def _check_origin(self, url: str) -> None:
        if not url.startswith((self.url, "blob:", "data:")):
            self._wrong.append(f"the page asked for {url}")

    def leave(self) -> None:
        """Close the browser's window; nothing may have gone wrong in it."""
        self.context.close()
        assert not self._wrong, self._wrong

    def forgive(self) -> None:
        """Forget what has gone wrong so far."""
        self._wrong.clear()


def violations(page: Page) -> list[str]:
    """What breaks the rules of accessibility on the page as it is."""
    page.evaluate(_AXE)
    found, passes = page.evaluate(_RUN_AXE, _RULES)
    assert passes > 15, "axe has hardly looked"
    return [
        f"{one['id']}: {one['help']}: {[node['html'] for node in one['nodes']]}" for one in found
    ]
