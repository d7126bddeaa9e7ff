"""The control plane under many workers and many jobs: `make bench-scale`.

Redis and the monitors are real, as `plateau` starts them. The workers are simulated: they lease,
put real small partials, commit and renew by the code of real workers, but do not render.
Measured are every number of workers with every number of jobs, and given rates of slices, with one
monitor and with two.
"""

import statistics
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Final

from bench.support.processes import timed
from bench.support.report import Table, machine_table, p99, write_report
from bench.support.scale_farm import ControlPlane
from bench.support.scale_workers import Slice

#: What a table has of a load: the figures of each cell.
_GRIDS: Final = {
    "scale-slices": ("committed / merged in a second", ("committed", "merged")),
    "scale-latencies": (
        "lease median / p99, commit median / p99, ms",
        ("lease: median", "lease: p99", "commit: median", "commit: p99"),
    ),
}


@dataclass(frozen=True, kw_only=True)
class Plan:
    """How much is simulated."""

    workers: tuple[int, ...] = (1, 100, 1000)  #: each with each of the jobs
    jobs: tuple[int, ...] = (1, 30, 1000)
    render_s: float = 2.0  #: of a slice there
    rates: tuple[float, ...] = (1000.0,)  #: slices/s, asked of the most workers
    monitors: tuple[int, ...] = (1, 2)  #: with each of the rates
    warm_s: float = 1.0  #: after the first slices were committed
    seconds: float = 3.0
    size: int = 16  #: of partials, in pixels
    folder: str = "/dev/shm"  #: for blobs


@dataclass
class Found:
    """All that was measured."""

    loads: dict[str, dict[str, float]] = field(default_factory=dict)  #: by name: figures by name
    others: list[float] = field(default_factory=list)


def main() -> None:
    plan = Plan()
    write_report(
        "scale",
        tables(plan, measure(plan)),
        settings=asdict(plan),
        notes=[
            "Redis, monitors and the processes that simulate workers share one machine.",
            "A simulated worker waits instead of rendering; its partials are 16×16 pixels.",
            "Jobs have defaults: 25 spp a slice, an evaluation after four; no rule ends them.",
            "Redis waits for its disk as it does for users; blobs are in memory.",
            "Merges are those that monitors report every two seconds.",
            "A simulated worker, whose latencies these are, shares a process with hundreds.",
        ],
        document="scale.md",
    )


def measure(plan: Plan) -> Found:
    """Measure every load; the default plan takes some minutes."""
    found = Found()
    most, some = max(plan.workers), sorted(plan.jobs)[-2:][0]
    for workers in plan.workers:
        for jobs in plan.jobs:
            name = f"{workers} workers, {jobs} jobs"
            _add_load(found, plan, name, workers, jobs, plan.render_s)
    for monitors in plan.monitors:
        for rate in plan.rates:
            name = f"{rate:g}/s asked of {monitors} monitor{'s' * (monitors != 1)}"
            _add_load(found, plan, name, most, some, most / rate, monitors=monitors)
    return found


def _add_load(
    found: Found,
    plan: Plan,
    name: str,
    workers: int,
    jobs: int,
    render_s: float,
    monitors: int = 1,
) -> None:
    with (
        tempfile.TemporaryDirectory() as disk,
        tempfile.TemporaryDirectory(dir=plan.folder) as fast,
        ControlPlane(Path(disk), Path(fast) / "blobs", monitors=monitors) as farm,
    ):
        farm.add_jobs(jobs)
        with farm.workers(workers, render_s=render_s, size=plan.size) as done:
            time.sleep(1.5 * render_s + plan.warm_s)
            with timed() as took:
                before = farm.sample()
                time.sleep(plan.seconds)
                after = farm.sample()
    slices = [one for one in done if before.at < one.at <= after.at]
    spent = after.since(before)
    found.others.append(took.others)
    found.loads[name] = {
        "committed": len(slices) / spent.at,
        "merged": spent.merged / spent.at,
        "Redis": spent.redis_cpu_s / spent.at,
        "monitors": spent.monitors_cpu_s / spent.at,
        **_latencies(slices),
    }
    print(f"{name}: {found.loads[name]['committed']:.0f} slices/s", flush=True)


def _latencies(slices: Sequence[Slice]) -> dict[str, float]:
    values: dict[str, float] = {}
    for step in ("lease", "commit") if slices else ():
        times = [1000 * getattr(one, f"{step}_s") for one in slices]
        values |= {f"{step}: median": statistics.median(times), f"{step}: p99": p99(times)}
    return values


def tables(plan: Plan, found: Found) -> dict[str, Table]:
    """Return the tables: the machine, workers and jobs, rates."""

    def cell(load: str, names: Sequence[str]) -> str:
        values = [found.loads[load].get(name) for name in names]
        return " / ".join("–" if value is None else f"{value:.3g}" for value in values)

    def grid(head: str, names: Sequence[str]) -> Table:
        rows = [
            [
                f"{workers} workers",
                *(cell(f"{workers} workers, {jobs} jobs", names) for jobs in plan.jobs),
            ]
            for workers in plan.workers
        ]
        return [[head, *(f"{jobs} jobs" for jobs in plan.jobs)], *rows]

    def rows(names: Sequence[str]) -> Table:
        loads = [load for load in found.loads if "asked" in load]
        return [[load, *(cell(load, [name]) for name in names)] for load in loads]

    periods = {
        "a slice renders for": f"{plan.render_s:g} s",
        "measured for": f"{plan.seconds:g} s",
    }
    rates = ("committed", "merged", "Redis", "monitors", "commit: median", "commit: p99")
    head = ["committed, 1/s", "merged, 1/s", "Redis, cores", "monitors, cores"]
    return {
        "scale-machine": machine_table(periods, found.others),
        **{name: grid(*about) for name, about in _GRIDS.items()},
        "scale-rates": [
            [f"{max(plan.workers)} workers", *head, "commit, median, ms", "p99, ms"],
            *rows(rates),
        ],
    }


if __name__ == "__main__":
    main()
