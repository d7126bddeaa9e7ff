"""A thread hangs if it is in a wait that no signal could end."""

import threading
from pathlib import Path

import pytest

from plateau.farm.process import hang
from plateau.farm.process.hang import Hang
from tests.support.loop_disk import LoopDisk
from tests.support.until import until


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hang, "HUNG_S", 0.05)


def test_a_thread_that_waits_for_a_disk_hangs_until_the_disk_answers(tmp_path: Path) -> None:
    with LoopDisk(tmp_path / "disk") as disk:
        file = disk.folder / "file"
        thread = threading.Thread(target=file.write_text, args=("written",))
        disk.freeze()
        try:
            thread.start()
            watched = Hang(thread)
            until(watched.is_seen)
        finally:
            disk.thaw()
        thread.join()
        assert not watched.is_seen()
        assert file.read_text() == "written"


def test_a_thread_that_waits_for_another_does_not() -> None:
    over = threading.Event()
    thread = threading.Thread(target=over.wait)
    thread.start()
    watched = Hang(thread)
    seen = [watched.is_seen() or over.wait(0.04) for _ in range(5)]
    over.set()
    thread.join()
    assert not any(seen)
