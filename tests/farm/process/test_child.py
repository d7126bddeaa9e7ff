"""A process that answers questions; here it is one that repeats what it is told."""

import os
import threading
import time
from collections.abc import Iterator
from typing import IO

import psutil
import pytest

from plateau.farm.process.child import NoAnswer, read_part, serve, write_part
from plateau.farm.process.helper import HelperProcess
from tests.support.processes.relatives import children_running
from tests.support.until import until


def repeat(stream: IO[bytes]) -> bytes:
    words = read_part(stream)
    if words == b"fail":
        raise LookupError("there is nothing to say")
    if words == b"sleep":
        time.sleep(60)
    if words == b"numpy":
        import numpy as np  # noqa: F401

        return str(psutil.Process().num_threads()).encode()
    return words


@pytest.fixture
def helper() -> Iterator[HelperProcess]:
    helper = HelperProcess(__name__)
    yield helper
    helper.close()


def ask(helper: HelperProcess, words: bytes, limit_s: float = 60) -> bytes:
    return helper.ask(lambda stream: write_part(stream, words), limit_s)


def running() -> list[int]:
    return [one.pid for one in children_running(__name__)]


def test_one_process_answers_one_question_after_the_other(helper: HelperProcess) -> None:
    many = bytes(10**6)
    assert ask(helper, b"one") == b"one"
    (pid,) = running()
    assert ask(helper, many) == many
    assert running() == [pid]


def test_numpy_starts_no_threads_which_would_reserve_memory(helper: HelperProcess) -> None:
    assert ask(helper, b"numpy") == b"1"


def test_it_goes_when_it_is_asked_no_more() -> None:
    helper = HelperProcess(__name__, kept_s=0.1)
    for _ in range(3):
        assert ask(helper, b"here") == b"here"
        until(lambda: not running())


def test_one_that_has_died_meanwhile_is_started_again(helper: HelperProcess) -> None:
    ask(helper, b"one")
    victim = psutil.Process(*running())
    victim.kill()
    # A zombie whose threads still end is none to wait for yet
    os.waitid(os.P_PID, victim.pid, os.WEXITED | os.WNOWAIT)
    assert ask(helper, b"two") == b"two"


def test_a_process_that_fails_says_why_and_the_next_answers(helper: HelperProcess) -> None:
    with pytest.raises(NoAnswer, match=r"^LookupError: there is nothing to say$"):
        ask(helper, b"fail")
    assert not running()
    assert ask(helper, b"well") == b"well"


def test_one_that_is_late_is_ended(helper: HelperProcess) -> None:
    ask(helper, b"start")
    with pytest.raises(NoAnswer, match="it took more than 0 s"):
        ask(helper, b"sleep", 0.1)
    assert not running()


def test_a_question_that_cannot_be_written_ends_it(helper: HelperProcess) -> None:
    def write(_: object) -> None:
        raise LookupError("lost")

    with pytest.raises(LookupError, match="lost"):
        helper.ask(write, 60)
    assert not running()


def test_once_closed_it_is_asked_no_more(helper: HelperProcess) -> None:
    # Given one that is asked
    failed: list[str] = []

    def asks() -> None:
        with pytest.raises(NoAnswer) as error:
            ask(helper, b"sleep")
        failed.append(str(error.value))

    asking = threading.Thread(target=asks)
    asking.start()
    until(running)
    # When it is closed, the process ends, and no other begins
    helper.close()
    asking.join()
    assert failed == ["its process ended with status -9"]
    assert not running()
    with pytest.raises(NoAnswer, match="the monitor stops"):
        ask(helper, b"more")


if __name__ == "__main__":
    serve(repeat)
