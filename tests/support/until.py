"""Waiting, for as long as it takes and no longer."""

import time
from collections.abc import Callable
from typing import TypeVar

_Answer = TypeVar("_Answer")


def until(
    condition: Callable[[], _Answer | None],
    seconds: float = 120,
    complaint: Callable[[], str] = lambda: "waited in vain",
    *,
    every_s: float = 0.1,
) -> _Answer:
    """The condition's first true answer; fails with the complaint where none comes in time."""
    deadline, wait_s = time.monotonic() + seconds, 0.01
    while not (answer := condition()):
        assert time.monotonic() < deadline, complaint()
        time.sleep(wait_s)
        wait_s = min(1.5 * wait_s, every_s)
    return answer
