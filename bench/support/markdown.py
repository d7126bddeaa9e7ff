"""Tables of figures in Markdown, and their places in the documents.

A place is a pair of comments, ``<!-- NAME -->`` and ``<!-- /NAME -->``. A benchmark writes its
tables between them, so that no figure is copied by hand.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench import ROOT
from bench.support.report import OTHERS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

DOCS = ROOT / "docs" / "science"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def spread(one: Mapping[str, Any], decimals: int) -> str:
    """Return a figure of a report as text: its median, lowest and highest value."""
    values = one["value"], one["spread"]["lowest"], one["spread"]["highest"]
    return "{} ({} to {})".format(*(f"{value:.{decimals}f}" for value in values))


def machine(report: Mapping[str, Any], shown: Sequence[str]) -> str:
    """Return a table of a report's machine, these settings, and the other work meanwhile."""
    about, settings = report["machine"], report["settings"]
    others = next(one for one in report["figures"] if one["name"] == OTHERS)
    row = [f"{about['cpu']}, {about['os']}", about["cores"], *map(settings.get, shown)]
    row += [f"{others['value']:.0%}, {others['spread']['highest']:.0%} at most"]
    return table(["machine", "cores", *shown, "other work on the cores"], [list(map(str, row))])


def places(document: Path) -> dict[str, str]:
    """Return the content of each place of a document, by name."""
    place = r"<!-- ([\w-]+) -->\n\n?(.*?)\n?<!-- /\1 -->"
    return dict(re.findall(place, document.read_text(), re.DOTALL))


def fill(document: Path, tables: Mapping[str, str]) -> None:
    """Write tables into their places in a document; skip those without a place."""
    text = document.read_text()
    for name in tables.keys() & places(document).keys():
        start, end = f"<!-- {name} -->\n", f"<!-- /{name} -->"
        before, rest = text.split(start)
        text = f"{before}{start}\n{tables[name]}\n{end}{rest.split(end)[1]}"
    document.write_text(text)
