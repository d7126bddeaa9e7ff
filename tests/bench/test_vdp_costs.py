"""What docs/science/metric.md says in words of the compiled metric's cost is what was found."""

import json

import pytest

from bench.support import markdown, report

DOCUMENT = markdown.DOCS / "metric.md"
#: A figure, and how the text has it.
COSTS = {
    "importing metric.compiled": "{:.2g} s",
    "compiling the kernels": "{:.2g} s",
    "loading them from the cache": "{:.2g} s",
    "the cache": "{:.2g} MiB",
    "2160p: peak memory, both images and the interpreter included": "{:.0f} MiB",
}


@pytest.fixture(scope="module")
def found() -> dict[tuple[str, str | None], float]:
    figures = json.loads((report.RESULTS / "vdp.json").read_text())["figures"]
    return {(one["name"], one["compared_with"]): one["value"] for one in figures}


@pytest.mark.parametrize("cost", COSTS)
def test_what_it_takes_to_start(cost: str, found: dict[tuple[str, str | None], float]) -> None:
    words = COSTS[cost].format(found[cost, None])
    assert words in " ".join(DOCUMENT.read_text().split())
