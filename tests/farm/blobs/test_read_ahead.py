"""Blobs are read before their turn where that is faster, in their order, and not too many."""

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from plateau.farm.blobs import read_ahead
from plateau.farm.blobs.read_ahead import THREADS, ReadAhead, Series
from plateau.farm.blobs.store import Blobs
from tests.support.until import until

NAMES = [f"jobs/0123456789ab/partials/{index:06d}-a.exr" for index in range(40)]
SIZE = 1000
_DELAY_S = 3 * read_ahead.SLOW_S


class FarStore(Blobs):
    """A store that answers only when it may, and knows who asks."""

    def __init__(self, where: str) -> None:
        super().__init__(where)
        self.asked: list[str] = []
        self.may_answer = threading.Event()
        self.may_answer.set()

    def get(self, name: str) -> bytes:
        self.asked.append(name)
        time.sleep(_DELAY_S)
        assert self.may_answer.wait(60)
        return super().get(name)


@pytest.fixture
def far(tmp_path: Path) -> FarStore:
    made = FarStore(str(tmp_path / "blobs"))
    for index, name in enumerate(NAMES):
        made.put(name, bytes([index]) * SIZE)
    return made


@pytest.fixture
def ahead(far: FarStore) -> Iterator[ReadAhead]:
    made = ReadAhead(far)
    yield made
    far.may_answer.set()
    made.close()


def slow(ahead: ReadAhead, far: FarStore) -> None:
    """Have it learn how slow the store is."""
    for name in NAMES[:4]:
        ahead.read(far.get, name)
    far.asked.clear()


def series_of(ahead: ReadAhead, far: FarStore) -> Series[str, bytes]:
    return Series(ahead, far.get, len)


def test_a_slow_store_is_asked_for_several_at_a_time(far: FarStore, ahead: ReadAhead) -> None:
    slow(ahead, far)
    series = series_of(ahead, far)
    series.expect(NAMES)
    assert series.get(NAMES[0])[0] == 0
    # Whoever asks for the second one has as many asked for as there are threads
    far.may_answer.clear()
    found: list[bytes] = []
    asking = threading.Thread(target=lambda: found.append(series.get(NAMES[1])))
    asking.start()
    until(lambda: len(far.asked) == 2 + THREADS)
    far.may_answer.set()
    asking.join()
    # And each comes in its turn, read once
    found += [series.get(name) for name in NAMES[2:]]
    assert found == [bytes([index]) * SIZE for index in range(1, len(NAMES))]
    assert sorted(far.asked) == NAMES


def test_a_fast_store_is_asked_for_one_after_another(
    far: FarStore, ahead: ReadAhead, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(read_ahead, "SLOW_S", 60)
    series = series_of(ahead, far)
    series.expect(NAMES)
    for place, name in enumerate(NAMES):
        series.get(name)
        assert far.asked == NAMES[: place + 1]


def test_memory_is_bounded_over_all_series(
    far: FarStore, ahead: ReadAhead, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(read_ahead, "MOST_BYTES", 5 * SIZE)
    slow(ahead, far)
    one, other = series_of(ahead, far), series_of(ahead, far)
    for series, names in ((one, NAMES[:20]), (other, NAMES[20:])):
        series.expect(names)
        series.get(names[0])  # of the first one the size is unknown
    one.get(NAMES[1])
    other.get(NAMES[21])
    until(lambda: len(far.asked) == 4 + 5)
    # What is let go makes room, and is read again in its turn
    one.let_go()
    other.get(NAMES[22])
    until(lambda: len(far.asked) == 5 + 2 * 5)
    assert [one.get(name)[0] for name in NAMES[2:20]] == list(range(2, 20))


def test_an_error_comes_in_the_turn_of_its_blob(far: FarStore, ahead: ReadAhead) -> None:
    slow(ahead, far)
    far.delete(NAMES[3])
    series = series_of(ahead, far)
    series.expect(NAMES[:6])
    assert [series.get(name)[0] for name in NAMES[:3]] == [0, 1, 2]
    with pytest.raises(FileNotFoundError, match="000003"):
        series.get(NAMES[3])
    assert series.get(NAMES[4])[0] == 4


def test_whoever_waits_for_a_thread_is_seen_to_wait_for_the_store(
    far: FarStore, ahead: ReadAhead
) -> None:
    slow(ahead, far)
    far.may_answer.clear()
    begun = ahead.begin(far.get, NAMES[0], SIZE)
    assert begun is not None
    waiting = threading.Thread(target=lambda: ahead.result(begun, SIZE))
    waiting.start()
    until(lambda: far.called_since(waiting.ident or 0) is not None)
    far.may_answer.set()
    waiting.join()
    assert far.called_since(waiting.ident or 0) is None
