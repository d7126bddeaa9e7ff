"""How fast monitors merge what has been committed: `make bench-backlog`.

Redis and the monitors are real, as `plateau` starts them. They plan, and are then stopped, while
small made-up partials are committed to many jobs. Once the monitors run again, nothing else asks
Redis, so that what is measured is theirs: one monitor and two, in turns.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from bench.support import markdown
from bench.support.cores import others_meanwhile
from bench.support.farms.backlog import Merged, merged_backlog
from bench.support.farms.scale_farm import ControlPlane
from bench.support.report import Figure, figure, others_figure, write_report

_GOAL = "1000/s of one monitor"
#: Of monitors, longer than they are stopped.
_LEASE_S = 300.0
_PAIR_GOAL = "1.7 with two monitors, where cores allow"


@dataclass(frozen=True, kw_only=True)
class Plan:
    """How much is merged."""

    monitors: tuple[int, ...] = (1, 2)
    rounds: int = 3
    jobs: int = 30
    slices: int = 160  #: of each job
    size: int = 16  #: of partials, in pixels
    folder: str = "/dev/shm"  #: for blobs


@dataclass(frozen=True)
class Found:
    """Each round's measurements by number of monitors, and what else was on the cores."""

    merged: dict[int, list[Merged]]
    others: list[float]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=Plan.rounds)
    parser.add_argument("--jobs", type=int, default=Plan.jobs)
    parser.add_argument("--slices", type=int, default=Plan.slices, help="of each job")
    plan = Plan(**vars(parser.parse_args()))
    report = write_report(
        "backlog",
        figures(measure(plan)),
        settings=asdict(plan),
        notes=[
            "Partials are 16×16 pixels, blobs in memory; Redis waits for its disk.",
            "Jobs have defaults: an evaluation after four slices; no rule ends them.",
            "Measured until half of the slices are merged, so that all monitors have work.",
        ],
    )
    markdown.fill(markdown.DOCS / "scale.md", tables(report))


def measure(plan: Plan) -> Found:
    """Return what each number of monitors merges, in turns."""
    found = Found({count: [] for count in plan.monitors}, [])
    for _ in range(plan.rounds):
        for count in plan.monitors:
            with (
                tempfile.TemporaryDirectory() as disk,
                tempfile.TemporaryDirectory(dir=plan.folder) as fast,
                ControlPlane(
                    Path(disk), Path(fast) / "blobs", monitors=count, lease_s=_LEASE_S
                ) as farm,
                others_meanwhile() as others,
            ):
                merged = merged_backlog(farm, jobs=plan.jobs, slices=plan.slices, size=plan.size)
            found.merged[count].append(merged)
            found.others.append(others.share)
            print(f"{_name(count)}: {merged}, others {others.share:.0%}", flush=True)
    return found


def figures(found: Found) -> list[Figure]:
    """Return the figures of each number of monitors, and how many times one's two merge."""
    made = []
    for count, runs in found.merged.items():
        for name, unit in _UNITS.items():
            values = [getattr(one, name) for one in runs]
            goal = _GOAL if (name, count) == ("ready_rate", 1) else None
            made.append(figure(f"{_name(count)}: {_WORDS[name]}", values, unit, goal=goal))
    first, *more = found.merged
    for count in more:
        for name in ("rate", "ready_rate"):
            ratios = [
                getattr(many, name) / getattr(one, name)
                for one, many in zip(found.merged[first], found.merged[count], strict=True)
            ]
            made.append(
                figure(
                    f"{_name(count)}: {_WORDS[name]}, by that of {_name(first)}",
                    ratios,
                    "ratio",
                    compared_with=f"{_name(first)}, in the same round",
                    goal=_PAIR_GOAL,
                )
            )
    return [*made, others_figure(found.others)]


_UNITS = {
    "rate": "1/s",
    "ready_rate": "1/s",
    "cpu_us": "µs",
    "redis_us": "µs",
    "round_trips": "calls",
}
_WORDS = {
    "rate": "merged",
    "ready_rate": "merged, waits for a core left out",
    "cpu_us": "CPU of a slice",
    "redis_us": "Redis, of a slice",
    "round_trips": "round trips of a slice",
}


def _name(count: int) -> str:
    return f"{count} monitor{'s' * (count != 1)}"


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return a report as Markdown: a row for each number of monitors, and the machine."""
    found = {one["name"]: one["value"] for one in report["figures"]}
    counts = report["settings"]["monitors"]
    first = _name(counts[0])
    rows = [
        [
            _name(count),
            *(f"{found[f'{_name(count)}: {words}']:.3g}" for words in _WORDS.values()),
            *(
                f"{found.get(f'{_name(count)}: {_WORDS[name]}, by that of {first}', 1):.2f}"
                for name in ("rate", "ready_rate")
            ),
        ]
        for count in counts
    ]
    head = [
        "",
        "merged, 1/s",
        "without waits for a core, 1/s",
        "CPU of a slice, µs",
        "Redis, µs",
        "round trips",
        "times one monitor",
        "without waits for a core",
    ]
    work = {"jobs": report["settings"]["jobs"], "slices of each": report["settings"]["slices"]}
    return {
        "backlog-machine": markdown.machine({**report, "settings": work}, tuple(work)),
        "backlog": markdown.table(head, rows),
    }


if __name__ == "__main__":
    main()
