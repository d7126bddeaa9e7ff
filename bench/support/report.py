"""Reports of benchmarks: small tables, in ``bench/results`` and in the documents.

A document has a place for a table, a pair of comments ``<!-- NAME -->`` and ``<!-- /NAME -->``, and
a benchmark writes its tables there, so that no figure is copied by hand.
"""

import json
import os
import platform
import re
import statistics
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime, timezone
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import psutil

from bench import ROOT
from plateau.worker.supervisor.identity import cpu
from plateau.worker.supervisor.llvm_libraries import llvm_libraries
from plateau.worker.supervisor.llvm_libraries import version as llvm_version

RESULTS: Final = ROOT / "bench" / "results"
DOCS: Final = ROOT / "docs" / "science"
OTHERS: Final = "other work on the cores"

#: The head, and the rows; the first cell of a row says what it is of.
Table = list[list[str]]


def write_report(
    name: str,
    tables: Mapping[str, Table],
    *,
    settings: Mapping[str, Any],
    notes: Sequence[str] = (),
    document: str | None = None,
    key: Callable[[str], str] = str,
) -> None:
    """Write ``bench/results/NAME.json`` and the document's tables, and print them.

    Rows of the last report stay if no new row has the same `key` of its first cell: so scenes can
    be measured one after the other.
    """
    known = last_tables(name)
    tables = {one: renewed(known.get(one), table, key) for one, table in tables.items()}
    about = {
        "benchmark": name,
        "at": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "machine": machine(),
        "settings": settings,
        "notes": list(notes),
    }
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / f"{name}.json").write_text(_as_json(about, {**known, **tables}))
    for one, table in tables.items():
        print(f"{one}\n\n{markdown(table)}")
    if document is not None:
        fill(DOCS / document, {one: markdown(table) for one, table in tables.items()})


def last_tables(name: str) -> dict[str, Table]:
    """Return the tables of the last report of this name."""
    path = RESULTS / f"{name}.json"
    tables: dict[str, Table] = json.loads(path.read_text())["tables"] if path.exists() else {}
    return tables


def renewed(known: Table | None, new: Table, key: Callable[[str], str] = str) -> Table:
    """Return a table whose rows are replaced by those with the same key, in their place."""
    if known is None:
        return new
    head, *rows = new
    made: Table = [head]
    for row in known[1:]:
        same = [one for one in rows if key(one[0]) == key(row[0])]
        made += same or ([] if key(row[0]) in {key(one[0]) for one in new[1:]} else [row])
        rows = [one for one in rows if one not in same]
    return made + rows


def _as_json(about: Mapping[str, Any], tables: Mapping[str, Table]) -> str:
    """Return a report as JSON, with a line for each row."""

    def inline(value: Any) -> str:
        return json.dumps(value, ensure_ascii=False)

    parts = [f"  {inline(name)}: {inline(value)}" for name, value in about.items()]
    rows = [
        f"    {inline(name)}: [\n" + ",\n".join(f"      {inline(row)}" for row in table) + "\n    ]"
        for name, table in tables.items()
    ]
    return "{\n" + ",\n".join(parts) + ',\n  "tables": {\n' + ",\n".join(rows) + "\n  }\n}\n"


def markdown(table: Table) -> str:
    """Return a table as Markdown."""
    head, *rows = table
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def spread(values: Sequence[float], decimals: int) -> str:
    """Return the median and, of several, the lowest and highest value."""
    found = (f"{one:.{decimals}f}" for one in (statistics.median(values), min(values), max(values)))
    return ("{} ({} to {})" if len(values) > 1 else "{}").format(*found)


def p99(values: Sequence[float]) -> float:
    """Return the 99th percentile: of less than a hundred values, the largest."""
    return sorted(values)[-(-99 * len(values) // 100) - 1]


def machine_table(settings: Mapping[str, Any], others: Sequence[float] = ()) -> Table:
    """Return this machine, settings of a run, and the share of the cores that other work took."""
    about = machine()
    head = ["machine", "cores", *settings]
    row = [f"{about['cpu']}, {about['os']}", about["cores"], *settings.values()]
    if others:
        head.append(OTHERS)
        row.append(f"{statistics.median(others):.0%}, {max(others):.0%} at most")
    return [head, list(map(str, row))]


def places(document: Path) -> dict[str, str]:
    """Return the content of each place of a document, by name."""
    place = r"<!-- ([\w-]+) -->\n\n?(.*?)\n?<!-- /\1 -->"
    return dict(re.findall(place, document.read_text(), re.DOTALL))


def fill(document: Path, texts: Mapping[str, str]) -> None:
    """Write texts into their places in a document; skip those without a place."""
    text = document.read_text()
    for name in texts.keys() & places(document).keys():
        start, end = f"<!-- {name} -->\n", f"<!-- /{name} -->"
        before, rest = text.split(start)
        text = f"{before}{start}\n{texts[name]}\n{end}{rest.split(end)[1]}"
    document.write_text(text)


def machine() -> dict[str, Any]:
    """Return everything about this machine that may affect a figure, its present load included."""
    libraries = llvm_libraries()
    return {
        "cpu": cpu(),
        "cores": len(os.sched_getaffinity(0)),
        "memory_gib": round(psutil.virtual_memory().total / 2**30, 1),
        "load_average_1_min": round(os.getloadavg()[0], 2),
        "os": platform.platform(),
        "python": platform.python_version(),
        "numpy": version("numpy"),
        "mitsuba": version("mitsuba"),
        "llvm": ".".join(map(str, llvm_version(libraries[0]))) if libraries else None,
    }
