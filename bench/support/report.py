"""The report of a benchmark: its figures, the machine and the date."""

from __future__ import annotations

import json
import os
import platform
import re
import statistics
from dataclasses import asdict, dataclass, replace
from datetime import datetime, timezone
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import psutil

from bench import ROOT
from plateau.worker.supervisor.llvm_libraries import llvm_libraries
from plateau.worker.supervisor.llvm_libraries import version as llvm_version

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

RESULTS = ROOT / "bench" / "results"
OTHERS = "other work on the cores meanwhile"


@dataclass(frozen=True, kw_only=True)
class Spread:
    """The range of the runs behind a figure."""

    lowest: float
    highest: float
    runs: int


@dataclass(frozen=True, kw_only=True)
class Figure:
    """One number, with everything needed to read it."""

    name: str
    value: float
    unit: str  #: such as ``ratio``, ``s``, ``spp/s``
    compared_with: str | None = None  #: in words; None for a plain measurement
    goal: str | None = None  #: in words
    spread: Spread | None = None


def figure(
    name: str,
    values: Sequence[float],
    unit: str,
    *,
    compared_with: str | None = None,
    goal: str | None = None,
) -> Figure:
    """Return the median of the runs as a figure, with their spread."""
    return Figure(
        name=name,
        value=_significant(statistics.median(values)),
        unit=unit,
        compared_with=compared_with,
        goal=goal,
        spread=Spread(
            lowest=_significant(min(values)), highest=_significant(max(values)), runs=len(values)
        ),
    )


def p99(values: Sequence[float]) -> float:
    """Return the 99th percentile: of less than a hundred values, the largest."""
    return sorted(values)[-(-99 * len(values) // 100) - 1]


def others_figure(shares: Sequence[float]) -> Figure:
    """Return other work's share of the cores, which makes times too long."""
    return figure(OTHERS, shares, "of the cores", goal="none, for figures to quote")


def write_report(
    name: str, figures: Sequence[Figure], *, settings: dict[str, Any], notes: Sequence[str]
) -> dict[str, Any]:
    """Write ``bench/results/NAME.json``, print its figures, and return it as it is read again.

    Parameters
    ----------
    name
        The name of the benchmark.
    figures
        The figures that it measured.
    settings
        The values with which it ran.
    notes
        What was left out, and what a reader might misunderstand.
    """
    report = {
        "benchmark": name,
        "at": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "machine": machine(),
        "settings": settings,
        "notes": list(notes),
        "figures": [asdict(one) for one in figures],
    }
    RESULTS.mkdir(exist_ok=True)
    path = RESULTS / f"{name}.json"
    path.write_text(json.dumps(report, indent=2, ensure_ascii=False) + "\n")
    for one in figures:
        print(in_words(one))
    print(f"written to {path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path}")
    return last_report(name)


def last_figures(name: str) -> list[Figure]:
    """Return the last report's figures; those of cases that are not measured now stay."""
    made = last_report(name)["figures"]
    return [Figure(**{**one, "spread": one["spread"] and Spread(**one["spread"])}) for one in made]


def last_report(name: str) -> dict[str, Any]:
    """Return the last report of this name, or an empty one if there is none."""
    path = RESULTS / f"{name}.json"
    nothing: dict[str, Any] = {"settings": {}, "figures": []}
    return json.loads(path.read_text()) if path.exists() else nothing


def renewed(kept: list[Figure], case: str, figures: Iterable[Figure]) -> list[Figure]:
    """The figures with those of a case replaced; their names begin with its name."""
    others = [one for one in kept if not one.name.startswith(f"{case}: ")]
    return others + [replace(one, name=f"{case}: {one.name}") for one in figures]


def in_words(one: Figure) -> str:
    """Return a figure as one line."""
    words = f"{one.name}: {one.value:g} {one.unit}"
    if one.spread is not None:
        words += f" ({one.spread.lowest:g} to {one.spread.highest:g} in {one.spread.runs} runs)"
    if one.compared_with is not None:
        words += f", compared with {one.compared_with}"
    if one.goal is not None:
        words += f"; goal: {one.goal}"
    return words


def machine() -> dict[str, Any]:
    """Return everything about this machine that may affect a figure, its present load included."""
    libraries = llvm_libraries()
    return {
        "cpu": _cpu_model(),
        "cores": len(os.sched_getaffinity(0)),
        "memory_gib": round(psutil.virtual_memory().total / 2**30, 1),
        "load_average_1_min": round(os.getloadavg()[0], 2),
        "os": platform.platform(),
        "python": platform.python_version(),
        "numpy": version("numpy"),
        "mitsuba": version("mitsuba"),
        "llvm": ".".join(map(str, llvm_version(libraries[0]))) if libraries else None,
    }


def _cpu_model() -> str:
    information = Path("/proc/cpuinfo")
    if information.exists():
        found = re.search(r"^model name\s*:\s*(.+)$", information.read_text(), re.MULTILINE)
        if found:
            return found[1]
    return platform.processor() or platform.machine()


def _significant(value: float) -> float:
    return float(f"{value:.4g}")
