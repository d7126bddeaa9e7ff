"""The control plane under many workers and many jobs: `make bench-scale`.

Redis and the monitors are real, as `plateau` starts them. The workers are simulated: they lease,
put real small partials, commit and renew by the code of real workers, but do not render.
Measured are the cost of each request to Redis; every number of workers with every number of jobs;
given rates of slices, with one monitor and with two; and the cost of workers without jobs, and of
jobs without workers.
"""

from __future__ import annotations

import argparse
import statistics
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from bench.support import markdown
from bench.support.load.scale_load import Found, Plan, Seen, measure
from bench.support.report import Figure, figure, others_figure, p99, write_report

if TYPE_CHECKING:
    from collections.abc import Sequence

_LOG = ": Redis's log"
_PARTIAL = ": a partial"
#: A planned farm: its workers, how long each renders a slice, and the requests to Redis for each
#: slice, with an evaluation after every fourth.
_PLANNED = 10_000
_PLANNED_RENDER_S = (10, 60, 300)
_HEARTBEAT_S = 5
_ASKED = {
    "lease a slice": 1.0,
    "commit a slice": 1.0,
    "monitor: read a job": 1.0,
    "monitor: read what is committed": 1.0,
    "monitor: plan": 0.125,
    "monitor: a point of the curve": 0.25,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, value in asdict(Plan()).items():
        many: dict[str, Any] = {"nargs": "*"} if isinstance(value, tuple) else {}
        kind = type(value[0] if isinstance(value, tuple) else value)
        option = f"--{name.replace('_', '-')}"
        parser.add_argument(option, type=kind, default=value, help=f"{value} if not given", **many)
    given: dict[str, Any] = vars(parser.parse_args())
    for name, value in given.items():
        if isinstance(value, list):
            given[name] = tuple(value)
    plan = Plan(**given)
    report = write_report(
        "scale",
        figures(measure(plan)),
        settings=asdict(plan),
        notes=[
            "Redis, monitors and the processes that simulate workers share one machine.",
            "A simulated worker waits instead of rendering; its partials are 16×16 pixels.",
            "Jobs have defaults: 25 spp a slice, an evaluation after four; no rule ends them.",
            "Redis waits for its disk as it does for users; blobs are in memory unless stated.",
            "Merges are those that monitors report every two seconds.",
            "A simulated worker, whose latencies these are, shares a process with hundreds.",
        ],
    )
    markdown.fill(markdown.DOCS / "scale.md", tables(report))


def figures(found: Found) -> list[Figure]:
    """Return the figures: the costs of requests, then those of each load."""
    return [
        *(one for name, cost in found.costs.items() for one in _costs(name, *cost)),
        *(one for name, cost in found.merges.items() for one in _merges(name, *cost)),
        *(one for seen in found.seen for one in _seen(seen)),
        others_figure([seen.others for seen in found.seen]),
    ]


def _costs(name: str, cpu_us: float, log_bytes: float) -> list[Figure]:
    return [
        figure(f"{name}: Redis", [cpu_us], "µs"),
        figure(f"{name}{_LOG}", [log_bytes], "bytes"),
    ]


def _merges(size: str, cpu_ms: float, partial_bytes: float) -> list[Figure]:
    return [
        figure(f"{size}: a merge", [cpu_ms], "ms"),
        figure(f"{size}{_PARTIAL}", [partial_bytes], "bytes"),
    ]


def _seen(seen: Seen) -> list[Figure]:
    spent, slices = seen.spent, max(1, len(seen.slices))
    values = {
        "planned": (seen.planned_s, "s"),
        "committed": (len(seen.slices) / spent.at, "1/s"),
        "merged": (spent.merges / spent.merged_at if spent.merged_at else 0.0, "1/s"),
        "Redis": (spent.redis_cpu_s / spent.at, "cores"),
        "Redis, commands": (spent.commands / spent.at, "1/s"),
        "Redis, scripts": (spent.scripts / spent.at, "1/s"),
        "monitors": (spent.monitors_cpu_s / spent.at, "cores"),
    }
    if seen.slices:
        values |= {
            "Redis, of a slice": (1e6 * spent.redis_cpu_s / slices, "µs"),
            "Redis's log, of a slice": (spent.log_bytes / slices, "bytes"),
            "commands, of a slice": (spent.commands / slices, "calls"),
            "monitor, of a slice": (
                1e6 * spent.monitors_cpu_s / spent.at / max(1e-9, values["merged"][0])
                if values["merged"][0]
                else 0.0,
                "µs",
            ),
            "merge, its fetch included": (spent.merges_us / max(1, spent.merges), "µs"),
            "evaluation": (spent.evaluations_us / max(1, spent.evaluations), "µs"),
        }
        for step in ("lease", "put", "commit"):
            times = [1000 * getattr(one, f"{step}_s") for one in seen.slices]
            values[f"{step}: median"] = statistics.median(times), "ms"
            values[f"{step}: p99"] = p99(times), "ms"
    return [figure(f"{seen.name}: {name}", [value], unit) for name, (value, unit) in values.items()]


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return a report as Markdown: the machine, requests, workers and jobs, rates, idleness."""
    found = {one["name"]: one["value"] for one in report["figures"]}
    settings = report["settings"]
    periods = {
        "a slice renders for": f"{settings['render_s']:g} s",
        "measured for": f"{settings['seconds']:g} s",
    }

    def grid(head: str, *names: str) -> str:
        def cell(workers: int, jobs: int) -> str:
            values = [found.get(f"{workers} workers, {jobs} jobs: {name}") for name in names]
            return " / ".join("–" if value is None else f"{value:.3g}" for value in values)

        return markdown.table(
            [head, *(f"{jobs} jobs" for jobs in settings["jobs"])],
            [
                [f"{workers} workers", *(cell(workers, jobs) for jobs in settings["jobs"])]
                for workers in settings["workers"]
            ],
        )

    def rows(head: Sequence[str], starts: Sequence[str], names: Sequence[str]) -> str:
        return markdown.table(
            head,
            [
                [start, *(f"{found.get(f'{start}: {one}', 0):.3g}" for one in names)]
                for start in starts
            ],
        )

    loads = [name.rpartition(": committed")[0] for name in found if name.endswith(": committed")]
    sizes = [name.removesuffix(_PARTIAL) for name in found if name.endswith(_PARTIAL)]
    requests = [name[: -len(_LOG)] for name in found if name.endswith(_LOG)]
    return {
        "scale-machine": markdown.machine({**report, "settings": periods}, tuple(periods)),
        "scale-costs": rows(
            ["", "Redis, µs", "its log, bytes"],
            requests,
            ["Redis", "Redis's log"],
        ),
        "scale-merges": rows(
            ["", "CPU of a merge, ms", "a partial, bytes"], sizes, ["a merge", "a partial"]
        ),
        "scale-plan": _plan(found, sizes[1:]),
        "scale-slices": grid("committed / merged in a second", "committed", "merged"),
        "scale-latencies": grid(
            "lease median / p99, commit median / p99, ms",
            "lease: median",
            "lease: p99",
            "commit: median",
            "commit: p99",
        ),
        "scale-shares": grid(
            "Redis / monitor, cores; Redis, µs of a slice", "Redis", "monitors", "Redis, of a slice"
        ),
        "scale-rates": rows(
            [
                f"{max(settings['workers'])} workers",
                "committed, 1/s",
                "merged, 1/s",
                "Redis, cores",
                "monitors, cores",
                "commit, median, ms",
                "p99, ms",
            ],
            [one for one in loads if "asked" in one],
            ["committed", "merged", "Redis", "monitors", "commit: median", "commit: p99"],
        ),
        "scale-idle": rows(
            ["", "Redis, cores", "its commands, 1/s", "its scripts, 1/s", "monitor, cores"],
            [one for one in loads if one.endswith((" idle workers", " waiting jobs"))],
            ["Redis", "Redis, commands", "Redis, scripts", "monitors"],
        ),
    }


def _plan(found: dict[str, float], sizes: Sequence[str]) -> str:
    """Return what a planned farm would need, by the costs of its single requests."""

    def asked(of: str) -> float:
        return sum(times * found[f"{name}{of}"] for name, times in _ASKED.items())

    beats = _PLANNED / _HEARTBEAT_S
    beat = "heartbeat with one lease"
    lines = []
    for render_s in _PLANNED_RENDER_S:
        rate = _PLANNED / render_s
        cores = (rate * asked(": Redis") + beats * found[f"{beat}: Redis"]) / 1e6
        log = (rate * asked(_LOG) + beats * found[f"{beat}{_LOG}"]) / 1e6
        values = [rate, cores, log]
        for size in sizes:
            values += [
                rate * found[f"{size}{_PARTIAL}"] / 1e9,
                rate * found[f"{size}: a merge"] / 1e3,
            ]
        lines.append([f"{render_s} s", *(f"{value:.2g}" for value in values)])
    head = ["a slice takes", "slices/s", "Redis, cores", "its log, MB/s"]
    of_size = [f"{size}: {what}" for size in sizes for what in ("partials, GB/s", "merges, cores")]
    return markdown.table([*head, *of_size], lines)


if __name__ == "__main__":
    main()
