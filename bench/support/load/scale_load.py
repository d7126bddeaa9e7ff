"""The loads of `bench.scale` on a control plane, and what is measured under them."""

from __future__ import annotations

import tempfile
import time
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from bench.support.cores import others_meanwhile
from bench.support.farms.scale_farm import ControlPlane, Sample
from bench.support.scale_costs import costs, merge_costs
from plateau.farm.blobs.store import Blobs

if TYPE_CHECKING:
    from collections.abc import Iterator

    from bench.support.farms.scale_workers import Slice

#: Sizes in pixels of the images whose merges are timed.
_SIZES = ((512, 512), (1920, 1080))


@dataclass(frozen=True, kw_only=True)
class Plan:
    """How much is simulated."""

    workers: tuple[int, ...] = (1, 100, 1000)  #: each with each of the jobs
    jobs: tuple[int, ...] = (1, 30, 1000)
    render_s: float = 2.0  #: of a slice there
    rates: tuple[float, ...] = (1000.0,)  #: slices/s, asked of the most workers
    monitors: tuple[int, ...] = (1, 2)  #: with each of the rates
    waiting: int = 1000  #: workers without jobs, and then jobs without workers
    turns: int = 300  #: of each request whose cost is measured
    warm_s: float = 1.0  #: after the first slices were committed
    seconds: float = 3.0
    size: int = 16  #: of partials, in pixels
    folder: str = "/dev/shm"  #: for blobs


@dataclass(frozen=True, kw_only=True)
class Seen:
    """The measurements under one load."""

    name: str
    planned_s: float  #: until slices of all jobs were planned
    spent: Sample
    slices: tuple[Slice, ...]  #: those that were committed meanwhile
    others: float  #: other work's share of the cores


@dataclass(frozen=True)
class Found:
    """All that was measured."""

    seen: list[Seen]
    costs: dict[str, tuple[float, float]]  #: of a request: µs of Redis, bytes of its log
    merges: dict[str, tuple[float, float]]  #: of a partial by size: CPU ms of a monitor, bytes


def measure(plan: Plan) -> Found:
    """Measure every load and cost; the default plan takes some minutes."""
    with _control_plane(plan, monitors=0) as farm:
        cost = costs(farm, jobs=max(plan.jobs), turns=plan.turns)
    with tempfile.TemporaryDirectory(dir=plan.folder) as folder:
        merges = merge_costs(Blobs(folder), ((plan.size, plan.size), *_SIZES))
    most, some = max(plan.workers), sorted(plan.jobs)[-2:][0]
    seen = [
        _load(plan, f"{workers} workers, {jobs} jobs", workers, jobs, plan.render_s)
        for workers in plan.workers
        for jobs in plan.jobs
    ]
    for monitors in plan.monitors:
        for rate in plan.rates:
            name = f"{rate:g}/s asked of {_count(monitors, 'monitor')}"
            seen.append(_load(plan, name, most, some, most / rate, monitors=monitors))
    rate = max(plan.rates)
    for name, changes in {
        f"{rate:g}/s asked, Redis not waiting for its disk": {"fsync": False},
        f"{rate:g}/s asked, blobs on the disk": {"on_disk": True},
    }.items():
        seen.append(_load(plan, name, most, some, most / rate, **changes))
    seen.append(_load(plan, f"{plan.waiting} idle workers", plan.waiting, 0, plan.render_s))
    seen.append(_load(plan, f"{plan.waiting} waiting jobs", 0, plan.waiting, plan.render_s))
    return Found(seen, cost, merges)


def _count(number: int, of: str) -> str:
    return f"{number} {of}{'s' * (number != 1)}"


@contextmanager
def _control_plane(
    plan: Plan, *, monitors: int = 1, fsync: bool = True, on_disk: bool = False
) -> Iterator[ControlPlane]:
    with (
        tempfile.TemporaryDirectory() as disk,
        tempfile.TemporaryDirectory(dir=plan.folder) as fast,
    ):
        blobs = Path(disk if on_disk else fast) / "blobs"
        with ControlPlane(Path(disk), blobs, monitors=monitors, fsync=fsync) as farm:
            yield farm


def _load(
    plan: Plan,
    name: str,
    workers: int,
    jobs: int,
    render_s: float,
    *,
    monitors: int = 1,
    fsync: bool = True,
    on_disk: bool = False,
) -> Seen:
    with _control_plane(plan, monitors=monitors, fsync=fsync, on_disk=on_disk) as farm:
        planned_s = farm.add_jobs(jobs)
        with farm.workers(workers, render_s=render_s, size=plan.size) as done:
            time.sleep(1.5 * render_s + plan.warm_s)
            with others_meanwhile() as others:
                before = farm.sample()
                time.sleep(plan.seconds)
                after = farm.sample()
    slices = tuple(one for one in done if before.at < one.at <= after.at)
    print(f"{name}: {len(slices) / (after.at - before.at):.0f} slices/s", flush=True)
    return Seen(
        name=name,
        planned_s=planned_s,
        spent=after.since(before),
        slices=slices,
        others=others.share,
    )
