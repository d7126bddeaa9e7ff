"""A blob store that fails for a while, or spoils what it holds, costs time and nothing else."""

import contextlib
import signal
import time
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path

import pytest

from plateau.farm.blobs import names as blobs
from tests.support.farms.every_time import EVERY_TIME
from tests.support.farms.faulty_farm import BRIEF, FaultyFarm
from tests.support.faults.invariants import Outcome, assert_same, outcome
from tests.support.faults.loop_disk import LoopDisk
from tests.support.long_tests import cases, rare
from tests.support.processes.forked import ForkServer

Submit = Callable[[], str]

#: Longer than a lease of these farms, which is 2 s.
LONGER_THAN_A_LEASE_S = 4.5


class SmallDisk:
    """A farm whose blobs are on a disk of 8 MB."""

    def __init__(self, farm: FaultyFarm, disk: LoopDisk) -> None:
        self.farm = farm
        self.disk = disk
        self._ballast = disk.folder / "ballast"

    def fill(self) -> None:
        with self._ballast.open("wb", buffering=0) as file, contextlib.suppress(OSError):
            while True:
                file.write(bytes(1 << 12))

    def free(self) -> None:
        self._ballast.unlink()

    def make_read_only(self) -> None:
        self.disk.make_read_only()

    def make_writable(self) -> None:
        self.disk.make_writable()

    def unmount(self) -> None:
        self.disk.unmount()

    def mount(self) -> None:
        self.disk.mount()


@pytest.fixture(scope="module")
def small_disk(
    tmp_path_factory: pytest.TempPathFactory, cache: Path, fork_server: ForkServer
) -> Iterator[SmallDisk]:
    home = tmp_path_factory.mktemp("small")
    with (
        LoopDisk(home / "disk", megabytes=8) as disk,
        FaultyFarm(home, cache, disk.folder / "blobs", fork_server, PLATEAU_LEASE_S="3") as farm,
    ):
        farm.start("monitor")
        farm.workers(2)
        farm.wait_for_workers(2)
        yield SmallDisk(farm, disk)


@pytest.mark.parametrize(
    ("fail", "heal"),
    [
        (SmallDisk.fill, SmallDisk.free),
        *rare(
            (SmallDisk.make_read_only, SmallDisk.make_writable),
            (SmallDisk.unmount, SmallDisk.mount),
        ),
    ],
    ids=["full", "read-only", "not mounted"],
)
def test_a_store_that_fails_for_longer_than_a_lease(
    small_disk: SmallDisk,
    undisturbed: Outcome,
    fail: Callable[[SmallDisk], None],
    heal: Callable[[SmallDisk], None],
) -> None:
    farm = small_disk.farm
    job = farm.submit_half_way(**BRIEF)
    try:
        fail(small_disk)
        time.sleep(LONGER_THAN_A_LEASE_S)
        assert not farm.jobs.get(job).state.ended
    finally:
        heal(small_disk)
    assert_same(outcome(farm, job), undisturbed)
    assert [one for one in farm.jobs.events(job) if one.type == "trouble"] == []
    assert all(process.poll() is None for process in farm.processes)


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
    farm: FaultyFarm,
    undisturbed: Outcome,
    submit: Submit,
    what: str,
    harm: Callable[[Path], None],
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
