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
    return {name: report.markdown(table) for name, table in tables.items()}


@pytest.mark.parametrize("document", DOCUMENTS)
def test_a_document_shows_what_was_found(document: str, texts: dict[str, str]) -> None:
    shown = report.places(report.DOCS / document)
    assert shown == {name: texts[name] for name in shown}
