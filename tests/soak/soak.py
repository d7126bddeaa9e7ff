"""A farm that is soaked: its twins, its comparisons, and what it leaves behind."""

import ctypes
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
from plateau.farm.ledger.api_keys import ApiKeys, KeyLimits, Role
from plateau.farm.model.states import JobState
from plateau.farm.sweep import sweep
from tests.soak.held import Watch
from tests.soak.kinds import KINDS, write_analytic
from tests.soak.users import Desk, Order
from tests.support.farms.faulty_farm import FaultyFarm
from tests.support.farms.real_farm import BOX
from tests.support.faults.invariants import Outcome, assert_same, check_job, is_of_no_job, outcome

#: How long users wait for a service that is struck.
_PATIENCE_S: Final = 120.0
_PR_SET_CHILD_SUBREAPER: Final = 36
_PLENTY: Final = KeyLimits()


class Soak:
    """The farm, and what was found so far.

    Its API, a monitor and a worker are never struck: their memory is judged.

    Parameters
    ----------
    farm
        The farm, whose API alone runs.
    folder
        A folder for files of its users.
    other_api
        URL of an API that will be struck.
    hook
        URL of a receiver of notices.
    """

    def __init__(self, farm: FaultyFarm, folder: Path, other_api: str, hook: str) -> None:
        self.farm = farm
        self.watch = Watch()
        self.compared = Counter[str]()  #: jobs with a twin, by kind
        self.cancelled = 0
        self.orphans = 0  #: blobs that sweeps removed: put, and never committed
        self._twins: dict[str, list[Outcome]] = {}
        api, *_ = farm.processes
        spared = {"API": api, "monitor": farm.start_patient("monitor")}
        spared["worker"] = farm.start_patient("worker")
        self._spared = {role: psutil.Process(one.pid) for role, one in spared.items()}
        made = ApiKeys(farm.redis_client)
        _, admin = made.create("admin", Role.ADMIN, _PLENTY)
        farm.client.close()
        self._clients = ExitStack()
        farm.client, other = (
            self._clients.enter_context(Client(url, key=admin, patience_s=_PATIENCE_S))
            for url in (farm.url, other_api)
        )
        scenes = {False: BOX, True: write_analytic(folder)}
        self.desk = Desk((farm.client, other), scenes, hook)

    def close(self) -> None:
        self._clients.close()

    def render_twins(self) -> None:
        """Have one of each kind rendered while nothing happens."""
        orders = [self.desk.order(kind, self.farm.client) for kind in KINDS]
        for order in orders:
            self._twins[order.kind.name] = [outcome(self.farm, job, 900) for job in order.jobs]
            self._delete(order)

    def look(self, minute: float) -> None:
        """Take a sample of what the farm's processes hold."""
        children = self._spared["worker"].children()
        render_child = next(filter(_is_render_child, children), None)
        server = psutil.Process(self.farm.redis.process.pid)
        roles = {**self._spared, "render child": render_child, "Redis": server}
        self.watch.look(minute, roles)

    def compare(self, orders: list[Order], damaged: Set[str]) -> None:
        """Compare what is finished with its twin, and remove it; it is taken from `orders`."""
        done = [order for order in orders if self._is_done(order)]
        self.orphans += sweep(self.farm.redis_client, self.farm.store).orphans
        for order in done:
            for job, twin in zip(order.jobs, self._twins[order.kind.name], strict=True):
                self._compare(job, order.kind.name, twin, damaged)
            orders.remove(order)
            self._delete(order)
        sweep(self.farm.redis_client, self.farm.store, deleted_older_than_s=0)

    def _compare(self, job: str, kind: str, twin: Outcome, damaged: Set[str]) -> None:
        farm = self.farm
        if farm.jobs.get(job).state is JobState.CANCELLED:
            check_job(farm.jobs, farm.store, farm.redis_client, job, damaged)
            self.cancelled += 1
        else:
            assert_same(outcome(farm, job, damaged=damaged), twin)
            self.compared[kind] += 1

    def _is_done(self, order: Order) -> bool:
        """Whether its results are written, and its receiver has heard of all."""
        if any(self.farm.jobs.get(job).finished_at is None for job in order.jobs):
            return False
        told = [one for job in order.jobs for one in self.farm.jobs.get(job).notices]
        return all(one.state == "delivered" for one in told)

    def _delete(self, order: Order) -> None:
        for job in order.jobs:
            self.farm.client.delete(job)


def _is_render_child(process: psutil.Process) -> bool:
    try:
        return "plateau.worker.child" in process.cmdline()
    except psutil.NoSuchProcess:  # it has just been struck
        return False


def leaks(client: redis.Redis, store: Blobs, temporary: Path) -> list[str]:
    """A line for whatever is left once all jobs are removed, and nobody does anything."""
    keys = client.scan_iter("*", count=1000)
    return [
        *(f"Redis: {key}" for key in keys if not is_of_no_job(key)),
        *(f"blob: {name}" for name in store.names(blobs.JOBS)),
        *(f"temporary file: {path.relative_to(temporary)}" for path in temporary.rglob("*")),
    ]


@contextmanager
def adopting() -> Iterator[Callable[[Collection[int]], list[str]]]:
    """Adopt children of processes that are killed; the function shows those that live.

    It is given the ids of those that are to live; whoever lives now does not count either.
    """
    c_library, us = ctypes.CDLL(None), psutil.Process()
    before = {child.pid for child in us.children()}
    c_library.prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)

    def alive(known: Collection[int]) -> list[str]:
        found = []
        for child in us.children():
            with suppress(psutil.NoSuchProcess):
                if child.pid not in before.union(known) and child.status() != psutil.STATUS_ZOMBIE:
                    found.append(" ".join(child.cmdline()))
        return found

    try:
        yield alive
    finally:
        c_library.prctl(_PR_SET_CHILD_SUBREAPER, 0, 0, 0, 0)
