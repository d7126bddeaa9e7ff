"""Figures in the documents are the benchmarks' own: each table is that of the results."""

import json
from pathlib import Path

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


def test_a_table_goes_to_its_place_and_to_no_other(tmp_path: Path) -> None:
    document = tmp_path / "a.md"
    document.write_text("one\n<!-- a -->\nold\n<!-- /a -->\ntwo\n<!-- b -->\n<!-- /b -->\n")
    table = report.markdown([["x"], ["1"]])
    report.fill(document, {"a": table, "c": "nowhere"})
    assert report.places(document) == {"a": table, "b": ""}
    before = document.read_text()
    report.fill(document, {"a": table})
    assert document.read_text() == before


def test_rows_are_renewed_in_their_places() -> None:
    known = [["scene", "spp"], ["A", "1"], ["A", "2"], ["B", "3"]]
    new = [["scene", "spp"], ["C", "4"], ["A", "5"]]
    assert report.renewed(known, new) == [["scene", "spp"], ["A", "5"], ["B", "3"], ["C", "4"]]
    assert report.renewed(None, new) == new


def test_a_report_keeps_what_is_not_measured_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(report, "RESULTS", tmp_path)
    report.write_report("x", {"a": [["", "s"], ["one", "1"]], "b": [[""]]}, settings={})
    report.write_report("x", {"a": [["", "s"], ["two", "2"]]}, settings={})
    assert report.last_tables("x") == {"a": [["", "s"], ["one", "1"], ["two", "2"]], "b": [[""]]}


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
