"""The report of a soak: ``bench/results/soak.json``, and tables in docs/science/soak.md."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timezone
from typing import Final

from bench.support.report import Table, machine, write_report
from tests.soak.held import Watch, most

_MB: Final = 1e6
_ROLES: Final = ("API", "monitor", "worker", "render child", "Redis")
_HEAD: Final = (
    *("", "own memory, MB: start", "middle", "end", "growth", "at most"),
    *("RSS at the end", "descriptors: middle", "end"),
)
_STAGES: Final = ("start", "middle", "end", "growth")


@dataclass(frozen=True, kw_only=True)
class Found:
    """What came of a soak."""

    minutes: float
    seed: int
    compared: Mapping[str, int]  #: jobs that were as their twins, by kind
    cancelled: int
    struck: Mapping[str, int]  #: faults by kind
    calls: int  #: of the API, by users
    messages: int  #: that a receiver of notices got
    orphans: int
    watch: Watch


def write(found: Found) -> None:
    """Write the report of a soak in which all was well, and its tables."""
    write_report(
        "soak",
        tables(found),
        settings={"seed": found.seed},
        notes=[
            "An API, a monitor and a worker with its render child are not struck, others are.",
            "Own memory is anonymous pages: without files, which processes share.",
            "Start, middle and end are medians of a tenth of the run each.",
            "Growth is the median slope after the first third, times the rest.",
        ],
        document="durability.md",
    )


def tables(found: Found) -> dict[str, Table]:
    """Return what happened, and what each process held."""
    jobs, about = {**found.compared, "cancelled": found.cancelled}, machine()
    today = datetime.now(timezone.utc).date()
    return {
        "soak": [
            ["", ""],
            ["date, machine", f"{today}, {about['cores']} cores, {about['cpu']}"],
            ["minutes of faults", f"{found.minutes:.1f}".removesuffix(".0")],
            ["jobs checked", f"{sum(jobs.values())}: {_listed(jobs)}"],
            ["faults", f"{sum(found.struck.values())}: {_listed(found.struck)}"],
            ["users' calls of the API", str(found.calls)],
            ["messages that a receiver got", str(found.messages)],
        ],
        "soak-memory": [
            list(_HEAD),
            *(_row(role, found.watch) for role in _ROLES if role in found.watch.series),
        ],
    }


def _listed(counts: Mapping[str, int]) -> str:
    most_first = sorted(sorted(counts.items()), key=lambda one: -one[1])
    return ", ".join(f"{count} {kind}" for kind, count in most_first)


def _row(role: str, watch: Watch) -> list[str]:
    trends = watch.trends(role)
    own = [getattr(trends["own"], stage) / _MB for stage in _STAGES]
    own.append(most("own", trends["own"]) / _MB)
    files = trends["descriptors"]
    rest = (trends["rss"].end / _MB, files.middle, files.end)
    return [role, *(f"{one:.1f}" for one in own), *(f"{one:.0f}" for one in rest)]
