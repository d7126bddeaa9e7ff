"""A thread hangs if its disk or its network mount does not answer, however it waits."""

import os
import threading
from collections.abc import Callable, Iterator, Set
from pathlib import Path

import psutil
import pytest

from plateau.farm.blobs.store import Blobs
from plateau.farm.model.errors import BlobsUnavailable
from plateau.farm.process import hang
from plateau.farm.process.hang import Hang
from tests.support.faults.loop_disk import LoopDisk
from tests.support.faults.silent_mount import SilentMount
from tests.support.until import until

Watch = Callable[[threading.Thread], Hang]


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hang, "HUNG_S", 0.5)


@pytest.fixture
def watch(store: Blobs) -> Iterator[Watch]:
    """Makes a `Hang`, and sees its tests of the disk end."""
    made: list[Hang] = []
    others = {one.pid for one in psutil.Process().children()}  # of earlier tests

    def make(thread: threading.Thread) -> Hang:
        made.append(Hang(thread, store))
        return made[-1]

    yield make
    until(lambda: not any(one.is_seen() for one in made) and not _tests_of_disks(others))


@pytest.fixture
def store(tmp_path: Path) -> Blobs:
    """A store with a mark and a blob."""
    blobs = Blobs(str(tmp_path / "blobs"))
    blobs.make_mark("farm")
    blobs.put("scenes/one", b"scene")
    return blobs


def test_a_thread_that_waits_for_a_disk_hangs_until_the_disk_answers(
    tmp_path: Path, watch: Watch
) -> None:
    with LoopDisk(tmp_path / "disk") as disk:
        file = disk.folder / "file"
        thread = threading.Thread(target=file.write_text, args=("written",))
        with disk.frozen():
            thread.start()
            watched = watch(thread)
            until(watched.is_seen)
        thread.join()
        assert not watched.is_seen()
        assert file.read_text() == "written"


@pytest.mark.parametrize("call", ["get", "put"])
def test_a_thread_whose_blobs_are_on_a_mount_that_stops_hangs_until_that_fails(
    tmp_path: Path, store: Blobs, watch: Watch, call: str
) -> None:
    failed: list[BlobsUnavailable] = []

    def work() -> None:
        try:
            store.get("scenes/one") if call == "get" else store.put("scenes/two", b"other")
        except BlobsUnavailable as error:
            failed.append(error)

    thread = threading.Thread(target=work)
    with SilentMount(tmp_path / "blobs"):
        thread.start()
        watched = watch(thread)
        until(watched.is_seen)
    thread.join()
    assert len(failed) == 1
    until(lambda: not watched.is_seen())
    assert store.get("scenes/one") == b"scene"


def test_a_thread_that_waits_for_a_blob_of_a_slow_store_does_not(
    tmp_path: Path, store: Blobs, watch: Watch, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hang, "HUNG_S", 3.0)  # a third of it is time enough for a test of the disk
    # Given a blob that takes its time, in a folder that answers
    slow = tmp_path / "blobs" / "scenes" / "slow"
    os.mkfifo(slow)
    thread = threading.Thread(target=store.get, args=("scenes/slow",))
    thread.start()
    watched = watch(thread)
    _seen(watched, seconds=4.0)  # by the way, where a busy machine is slow to test the disk
    until(lambda: not watched.is_seen())
    assert store.called_since(thread.ident or 0) is not None
    slow.open("wb").close()
    thread.join()


def test_a_thread_that_waits_for_another_does_not(watch: Watch) -> None:
    over = threading.Event()
    thread = threading.Thread(target=over.wait)
    thread.start()
    assert not _seen(watch(thread), seconds=2.0)
    over.set()
    thread.join()


def _tests_of_disks(others: Set[int]) -> list[psutil.Process]:
    """The processes that test disks, and those that ended and were not heard, but for `others`."""
    found = []
    for one in psutil.Process().children():
        if one.pid in others:
            continue
        try:
            command = one.cmdline()  # empty for one that is about to be a zombie
            if not command or "plateau.farm.process.disk_probe" in command:
                found.append(one)
        except psutil.ZombieProcess:
            found.append(one)
    return found


def _seen(watched: Hang, seconds: float) -> bool:
    """Whether the thread was ever seen to hang, by who looks ten times a second."""
    never = threading.Event()
    return any(watched.is_seen() or never.wait(0.1) for _ in range(round(10 * seconds)))
