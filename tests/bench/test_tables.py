"""Figures in the documents are the benchmarks' own: each table is made again from the results."""

import json

import pytest

from bench import (
    allocation,
    denoising,
    eyes,
    farm,
    paper,
    savings,
    scale,
    startup,
    vdp,
)
from bench.support import markdown, report
from tests.soak import report as soak


def figures(name: str) -> dict[str, object]:
    found: dict[str, object] = json.loads((report.RESULTS / f"{name}.json").read_text())
    return found


@pytest.fixture(scope="module")
def tables() -> dict[str, str]:
    return {
        "vdp": vdp.table(figures("vdp")),
        **allocation.tables(figures("allocation")),
        **denoising.tables(figures("denoising")),
        **eyes.tables(figures("eyes")),
        **farm.tables(figures("farm")),
        **scale.tables(figures("scale")),
        **soak.tables(figures("soak")),
        **startup.tables(figures("startup")),
        **paper.tables_of(paper.known()),
        **savings.tables_of(savings.known()),
    }


@pytest.mark.parametrize(
    "document",
    [
        "allocation.md",
        "denoising.md",
        "durability.md",
        "eyes.md",
        "metric.md",
        "stopping.md",
        "paper.md",
        "savings.md",
        "performance.md",
        "scale.md",
    ],
)
def test_a_document_shows_what_was_found(document: str, tables: dict[str, str]) -> None:
    shown = markdown.places(markdown.DOCS / document)
    assert shown
    assert shown == {name: tables[name] for name in shown}


def test_a_table_goes_to_its_place_and_to_no_other(tmp_path) -> None:
    document = tmp_path / "a.md"
    document.write_text("one\n<!-- a -->\nold\n<!-- /a -->\ntwo\n<!-- b -->\n<!-- /b -->\n")
    table = markdown.table(["x"], [["1"]])
    markdown.fill(document, {"a": table, "c": "nowhere"})
    assert markdown.places(document) == {"a": table, "b": ""}
    before = document.read_text()
    markdown.fill(document, {"a": table})
    assert document.read_text() == before
