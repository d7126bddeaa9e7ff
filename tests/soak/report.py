"""The report of a soak: ``bench/results/soak.json``, and tables in docs/durability.md."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from bench.support import markdown
from bench.support.report import Figure, write_report
from tests.soak.held import Watch, most

_MB: Final = 1e6
_ROLES: Final = ("API", "monitor", "worker", "render child", "Redis")
_CALLS: Final = "users' calls of the API"
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
    figures = [
        Figure(name="minutes", value=round(found.minutes, 1), unit="min"),
        *_counts("jobs", {**found.compared, "cancelled": found.cancelled}),
        *_counts("faults", found.struck),
        Figure(name=_CALLS, value=found.calls, unit="calls"),
        Figure(name="notices", value=found.messages, unit="messages"),
        Figure(name="blobs put and not committed, swept", value=found.orphans, unit="blobs"),
        *(one for role in found.watch.series for one in _held(found.watch, role)),
    ]
    report = write_report(
        "soak",
        figures,
        settings={"seed": found.seed},
        notes=[
            "An API, a monitor and a worker with its render child are not struck, others are.",
            "Own memory is anonymous pages: without files, which processes share.",
            "Start, middle and end are medians of a tenth of the run each.",
            "Growth is the median slope after the first third, times the rest.",
        ],
    )
    markdown.fill(markdown.DOCS / "durability.md", tables(report))


def _counts(of_what: str, counts: Mapping[str, int]) -> list[Figure]:
    return [
        Figure(name=f"{of_what}: {kind}", value=count, unit=of_what)
        for kind, count in sorted(counts.items())
    ]


def _held(watch: Watch, role: str) -> list[Figure]:
    made = [Figure(name=f"{role}: processes", value=len(watch.pids[role]), unit="processes")]
    for name, trend in watch.trends(role).items():
        is_memory = name in {"own", "rss", "pss"}
        scale, unit = (_MB, "MB") if is_memory else (1, name)
        for stage in _STAGES:
            value = round(getattr(trend, stage) / scale, 1)
            made.append(Figure(name=f"{role}: {name}, {stage}", value=value, unit=unit))
        if name == "own":
            bound = round(most(name, trend) / scale, 1)
            made.append(Figure(name=f"{role}: own, bound", value=bound, unit=unit))
    return made


def tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return a report as Markdown: what happened, and what each process held."""
    found = {one["name"]: one["value"] for one in report["figures"]}
    jobs, faults = _of("jobs", found), _of("faults", found)
    about = report["machine"]
    rows = [
        ["date, machine", f"{report['at'][:10]}, {about['cores']} cores, {about['cpu']}"],
        ["minutes of faults", f"{found['minutes']:g}"],
        ["jobs checked", f"{sum(jobs.values()):g}: {_listed(jobs)}"],
        ["faults", f"{sum(faults.values()):g}: {_listed(faults)}"],
        ["users' calls of the API", f"{found[_CALLS]:g}"],
        ["notices that a receiver got", f"{found['notices']:g}"],
    ]
    return {
        "soak": markdown.table(["", ""], rows),
        "soak-memory": markdown.table(
            _HEAD,
            [_row(role, found) for role in _ROLES if f"{role}: processes" in found],
        ),
    }


def _of(what: str, found: Mapping[str, float]) -> dict[str, float]:
    prefix = f"{what}: "
    return {
        name.removeprefix(prefix): value for name, value in found.items() if name.startswith(prefix)
    }


def _listed(counts: Mapping[str, float]) -> str:
    most_first = sorted(counts.items(), key=lambda one: -one[1])
    return ", ".join(f"{count:g} {kind}" for kind, count in most_first)


def _row(role: str, found: Mapping[str, float]) -> list[str]:
    own = [f"{found[f'{role}: own, {stage}']:.1f}" for stage in (*_STAGES, "bound")]
    rest = [found[f"{role}: {name}"] for name in ("rss, end", "descriptors, middle")]
    return [
        role,
        *own,
        f"{rest[0]:.0f}",
        f"{rest[1]:.0f}",
        f"{found[f'{role}: descriptors, end']:.0f}",
    ]
