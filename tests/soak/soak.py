"""A farm that is soaked: its twins, its comparisons, and what it leaves behind."""

import ctypes
import json
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Set
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

import psutil
import redis

from plateau.client import Client
from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.model.states import JobState
from plateau.farm.sweep import sweep
from tests.soak.held import Watch
from tests.soak.users import KINDS, Desk, Order
from tests.support.farms.faulty_farm import FaultyFarm
from tests.support.farms.real_farm import BOX
from tests.support.faults.invariants import Outcome, assert_same, check_job, is_of_no_job, outcome

#: How long users wait for a service that is struck.
_PATIENCE_S: Final = 120.0
_PR_SET_CHILD_SUBREAPER: Final = 36
_ANALYTIC: Final = {"analytic": 1, "light": "texture", "level": 0.5}


class Soak(ExitStack):
    """The farm, of which the API alone runs, and what was found so far.

    Its API, a monitor and a worker are never struck: their memory is judged. Users call another
    API besides, and a hook hears of their jobs.
    """

    def __init__(self, farm: FaultyFarm, folder: Path, other_api: str, hook: str) -> None:
        super().__init__()
        self.farm = farm
        self.watch = Watch()
        self.compared = Counter[str]()  #: jobs that were as their twins, by kind
        self.orphans = 0  #: blobs that sweeps removed: put, and never committed
        self._twins: dict[str, list[Outcome]] = {}
        api, *_ = farm.processes
        spared = {"API": api, "monitor": farm.start_patient("monitor")}
        spared["worker"] = farm.start_patient("worker")
        self._spared = {role: psutil.Process(one.pid) for role, one in spared.items()}
        farm.client.close()
        farm.client, other = (
            self.enter_context(Client(url, patience_s=_PATIENCE_S)) for url in (farm.url, other_api)
        )
        analytic = folder / "checks.json"
        analytic.write_text(json.dumps(_ANALYTIC))
        self.desk = Desk((farm.client, other), {False: BOX, True: analytic}, hook)

    def render_twins(self) -> None:
        """Have one of each kind rendered while nothing happens."""
        orders = [self.desk.order(kind, self.farm.client) for kind in KINDS]
        for order in orders:
            self._twins[order.kind] = [outcome(self.farm, job, 900) for job in order.jobs]
            self._delete(order)

    def look(self, minute: float) -> None:
        """Take a sample of what the farm's processes hold."""
        self.watch.look(minute, "Redis", psutil.Process(self.farm.redis.process.pid))
        for role, process in self._spared.items():
            self.watch.look(minute, role, process)
        for child in self._spared["worker"].children():
            with suppress(psutil.NoSuchProcess):
                if "plateau.worker.child" in child.cmdline():
                    self.watch.look(minute, "render child", child)

    def compare(self, orders: list[Order], damaged: Set[str]) -> None:
        """Compare what is finished with its twin, and remove it; it is taken from `orders`."""
        done = [order for order in orders if self._is_done(order)]
        self.orphans += sweep(self.farm.redis_client, self.farm.store).orphans
        for order in done:
            for job, twin in zip(order.jobs, self._twins[order.kind], strict=True):
                self._compare(job, order.kind, twin, damaged)
            orders.remove(order)
            self._delete(order)
        sweep(self.farm.redis_client, self.farm.store, deleted_older_than_s=0)

    def _compare(self, job: str, kind: str, twin: Outcome, damaged: Set[str]) -> None:
        farm = self.farm
        if farm.jobs.get(job).state is JobState.CANCELLED:
            check_job(farm.jobs, farm.store, farm.redis_client, job, damaged)
        else:
            assert_same(outcome(farm, job, damaged=damaged), twin)
        self.compared[kind] += 1

    def _is_done(self, order: Order) -> bool:
        """Whether its results are written, and its receiver has heard of all."""
        jobs = [self.farm.jobs.get(job) for job in order.jobs]
        told = all(one.state == "delivered" for job in jobs for one in job.notices)
        return told and all(job.finished_at is not None for job in jobs)

    def _delete(self, order: Order) -> None:
        for job in order.jobs:
            self.farm.client.delete(job)


def leaks(client: redis.Redis, store: Blobs, temporary: Path) -> list[str]:
    """A line for whatever is left once all jobs are removed, and nobody does anything."""
    keys = client.scan_iter("*", count=1000)
    return [
        *(f"Redis: {key}" for key in keys if not is_of_no_job(key)),
        *(f"blob: {name}" for name in store.names(blobs.JOBS)),
        *(f"temporary file: {path.relative_to(temporary)}" for path in temporary.rglob("*")),
    ]


@contextmanager
def adopting() -> Iterator[Callable[[Collection[int]], dict[int, str]]]:
    """Adopt children of processes that are killed; the function shows those that live.

    It is given the ids of those that are to live; whoever lives now does not count either.
    """
    c_library, us = ctypes.CDLL(None), psutil.Process()
    before = {child.pid for child in us.children()}
    c_library.prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)

    def alive(known: Collection[int]) -> dict[int, str]:
        found = {}
        for child in us.children():
            with suppress(psutil.NoSuchProcess):
                if child.pid not in before.union(known) and child.status() != psutil.STATUS_ZOMBIE:
                    found[child.pid] = " ".join(child.cmdline())
        return found

    try:
        yield alive
    finally:
        c_library.prctl(_PR_SET_CHILD_SUBREAPER, 0, 0, 0, 0)
