"""A blob store that fails for a while, or spoils what it holds, costs time and nothing else."""

import signal
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path

import pytest

from plateau.farm.blobs import names as blobs
from plateau.farm.redis import keys
from tests.support.farms.every_time import EVERY_TIME
from tests.support.farms.faulty_farm import BRIEF, FaultyFarm
from tests.support.faults.invariants import Outcome, assert_same, outcome
from tests.support.faults.loop_disk import LoopDisk
from tests.support.long_tests import cases, rare
from tests.support.until import until

Submit = Callable[[], str]


@pytest.fixture(scope="module")
def small_disk(
    tmp_path_factory: pytest.TempPathFactory, cache: Path
) -> Iterator[tuple[FaultyFarm, LoopDisk]]:
    """A farm whose blobs are on a disk of 8 MB, and the disk."""
    home = tmp_path_factory.mktemp("small")
    with (
        LoopDisk(home / "disk", megabytes=8) as disk,
        FaultyFarm(home, cache, disk.folder / "blobs", PLATEAU_LEASE_S="60") as farm,
    ):
        farm.start("monitor")
        farm.workers(2)
        farm.wait_for_workers(2)
        yield farm, disk


@pytest.mark.parametrize(
    ("fail", "heal"),
    [
        (LoopDisk.fill, LoopDisk.free),
        *rare(
            (LoopDisk.make_read_only, LoopDisk.make_writable), (LoopDisk.unmount, LoopDisk.mount)
        ),
    ],
    ids=["full", "read-only", "not mounted"],
)
def test_a_store_that_fails_costs_no_lease(
    small_disk: tuple[FaultyFarm, LoopDisk],
    undisturbed: Outcome,
    fail: Callable[[LoopDisk], object],
    heal: Callable[[LoopDisk], None],
) -> None:
    farm, disk = small_disk
    ended = True
    while ended:
        job = farm.submit_half_way(**BRIEF)
        try:
            fail(disk)
            # Leases of slices that cannot be put are renewed, if there are any
            ended = farm.jobs.get(job).state.ended or not _wait_for_renewals(farm)
        finally:
            heal(disk)
    assert_same(outcome(farm, job), undisturbed)
    assert [one for one in farm.jobs.events(job) if one.type == "trouble"] == []
    assert all(process.poll() is None for process in farm.processes)


def _wait_for_renewals(farm: FaultyFarm) -> bool:
    """Whether something was left to be renewed."""
    later = farm.jobs.now_ms() + 5000
    until(lambda: min(_times(farm, keys.WORKERS), default=0) > later, 45)
    # Before the first lease could have run out
    until(lambda: min(_times(farm, keys.LEASES), default=later + 1) > later, 45)
    return bool(_times(farm, keys.LEASES))


def _times(farm: FaultyFarm, key: str) -> list[float]:
    return [at for _, at in farm.redis_client.zrange(key, 0, -1, withscores=True)]


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:50])


def flip_a_byte(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


@pytest.mark.parametrize(
    ("what", "harm"),
    cases(
        product(["partials", "checkpoints"], [truncate, flip_a_byte, Path.unlink]),
        [("partials", flip_a_byte), *rare(("checkpoints", Path.unlink))],
    ),
)
def test_blobs_that_are_spoiled_at_rest(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit, what: str, harm: Callable[[Path], None]
) -> None:
    """Half-way through a job its monitor dies, and what it would have gone on from is harmed."""
    farm.start("worker")
    job = submit()
    victim = farm.start_armed(
        "monitor", "plateau.picture.merge:Merge.add_partial", time=13, constants=EVERY_TIME
    )
    farm.wait_until_ended(victim, signal.SIGKILL)
    prefix = {"partials": blobs.partials(job), "checkpoints": blobs.checkpoints(job)}[what]
    harmed = farm.store.names(prefix)
    assert harmed
    for name in harmed:
        harm(Path(farm.store.where) / name)
    farm.start("monitor")
    assert_same(outcome(farm, job), undisturbed)
