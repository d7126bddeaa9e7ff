"""Figures in the documents are the benchmarks' own: each table is that of the results."""

import json

import pytest

from bench import paper, savings
from bench.support import report, series

DOCUMENTS = sorted(path.name for path in report.DOCS.glob("*.md") if report.places(path))


@pytest.fixture(scope="module")
def texts() -> dict[str, str]:
    every = series.known()
    reports = [json.loads(path.read_text()) for path in report.RESULTS.glob("*.json")]
    tables = {name: table for one in reports for name, table in one["tables"].items()}
    made = {**paper.tables(every), "savings-summary": savings.summary_table(every)}
    # What is made of the series is what the reports have
    assert {name: tables[name] for name in made} == made
    return {
        **{name: report.markdown(table) for name, table in tables.items()},
        "savings-scenes": savings.scene_tables(every),
    }


@pytest.mark.parametrize("document", DOCUMENTS)
def test_a_document_shows_what_was_found(document: str, texts: dict[str, str]) -> None:
    shown = report.places(report.DOCS / document)
    assert shown == {name: texts[name] for name in shown}


#: What docs/science/metric.md says in words of the compiled metric's cost.
COSTS = {
    "importing metric.compiled": ".2g",
    "compiling the kernels": ".2g",
    "loading them from the cache": ".2g",
    "the cache": ".2g",
    "2160p: peak memory, both images and the interpreter included": ".0f",
}


def test_what_it_takes_to_start_is_what_was_found() -> None:
    words = " ".join((report.DOCS / "metric.md").read_text().split())
    found = {name: value.split() for name, value in report.last_tables("vdp")["vdp-costs"][1:]}
    for cost, form in COSTS.items():
        value, unit = found[cost]
        assert f"{float(value):{form}} {unit}" in words
