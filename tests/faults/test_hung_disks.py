"""A disk that does not answer hurts the process that waits for it, and nobody else.

So does a network mount, or a device. Nothing ends such a wait, not even SIGKILL, and the other
threads of the process live on meanwhile.
"""

import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path

import psutil
import pytest

from tests.support.farms.faulty_farm import FaultyFarm
from tests.support.faults.invariants import Outcome, assert_same, outcome
from tests.support.faults.loop_disk import LoopDisk
from tests.support.faults.silent_mount import BoundFolder, SilentMount
from tests.support.long_tests import cases, rare
from tests.support.until import until

Submit = Callable[[], str]

_HOST = "plateau.worker.supervisor.host:RenderHost"
#: The process, and where it is when its thread hangs.
_STAGES = {
    "a worker that renders": ("worker", f"{_HOST}.render", "before", 3),
    "a worker that uploads": ("worker", "plateau.farm.ledger.queue:SliceQueue.commit", "before", 2),
    "a monitor": ("monitor", "plateau.farm.ledger.ownership:Ownerships.append_point", "before", 4),
}
_SOON = {
    "plateau.farm.process.hang:HUNG_S": 1.0,
    "plateau.worker.supervisor.health:ANSWERS_S": 2.0,
    "plateau.farm.process.child:GONE_S": 1.0,
    "plateau.worker.supervisor.supervisor:_SIT_OUT_S": [0.5, 1.0],
}


@pytest.mark.parametrize("stage", cases(_STAGES, ["a worker that uploads", *rare("a monitor")]))
def test_others_take_the_work_of_a_process_that_hangs(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit, tmp_path: Path, stage: str
) -> None:
    role, where, when, nth = _STAGES[stage]
    farm.start("worker" if role == "monitor" else "monitor")
    job = submit()
    with LoopDisk(tmp_path / "disk") as disk:
        with disk.frozen():
            file = disk.folder / "file"
            stuck = farm.start_changed(
                role, where=where, when=when, time=nth, write=str(file), set=_SOON
            )
            until(lambda: _hangs(stuck.pid))
            if role == "worker":
                until(lambda: _troubles(farm))
            farm.start(role)
            assert_same(outcome(farm, job), undisturbed)
            assert _hangs(stuck.pid)
        # And it is of use again once its disk answers
        until(file.exists)
        farm.stop_all()


@pytest.mark.long
def test_a_worker_whose_cache_hangs_says_so_and_comes_back(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit, tmp_path: Path, cache: Path
) -> None:
    farm.start("monitor")
    with LoopDisk(tmp_path / "disk") as disk:
        shutil.copytree(
            cache, disk.folder / "cache", ignore=shutil.ignore_patterns("scenes", "home")
        )
        there = {"PLATEAU_CACHE": str(disk.folder / "cache"), "PLATEAU_CHILD_TIMEOUT_S": "10"}
        farm.start_changed("worker", environment=there, set=_SOON)
        with _in_mid_job(farm, submit, disk.frozen) as job:
            until(lambda: _troubles(farm))
            farm.start("worker")
            assert_same(outcome(farm, job), undisturbed)
        until(lambda: not _troubles(farm))
        farm.stop_all()


@pytest.mark.parametrize("role", ["monitor", *rare("worker")])
def test_others_take_the_work_of_a_process_whose_blobs_are_on_a_mount_that_stops(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit, tmp_path: Path, role: str
) -> None:
    farm.start("worker" if role == "monitor" else "monitor")
    with BoundFolder(Path(farm.store.where), tmp_path / "seen") as seen:
        there = {"PLATEAU_BLOBS": str(seen)}
        stuck = farm.start_changed(role, environment=there, set=_SOON)
        with _in_mid_job(farm, submit, lambda: SilentMount(seen)) as job:
            if role == "worker":
                until(lambda: _troubles(farm))
            farm.start(role)
            assert_same(outcome(farm, job), undisturbed)
            assert stuck.poll() is None
        # And it is of use again once its mount answers
        until(lambda: not _troubles(farm))
        farm.stop_all()


@contextmanager
def _in_mid_job(
    farm: FaultyFarm, submit: Submit, fault: Callable[[], AbstractContextManager[object]]
) -> Iterator[str]:
    """A job in whose middle the fault begins, which lasts as long as the context."""
    while True:
        job = submit()
        until(lambda: farm.jobs.get(job).points >= 2)  # noqa: B023  (it is asked here alone)
        with fault():
            if not farm.jobs.get(job).state.ended:
                yield job
                return


def _troubles(farm: FaultyFarm) -> list[str]:
    """What the workers say of disks that do not answer."""
    told = (str(worker.trouble) for worker in farm.client.workers())
    return [words for words in told if "does not answer" in words]


def _hangs(pid: int) -> bool:
    """Whether a thread is a second long in waits that no signal ends; a process starts in some."""
    hung = _uninterruptible(pid)
    for _ in range(10):
        time.sleep(0.1)
        hung &= _uninterruptible(pid)
    return bool(hung)


def _uninterruptible(pid: int) -> set[int]:
    """The threads of a process that no signal reaches just now."""
    found = set()
    for one in psutil.Process(pid).threads():
        with suppress(OSError):  # it has just ended
            stat = Path(f"/proc/{pid}/task/{one.id}/stat").read_text()
            if stat.rpartition(")")[2].split()[0] == "D":
                found.add(one.id)
    return found
