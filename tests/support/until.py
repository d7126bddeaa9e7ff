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
    every_s: float = 0.02,
) -> _Answer:
    """The condition's first true answer; fails with the complaint where none comes in time."""
    deadline = time.monotonic() + seconds
    while not (answer := condition()):
        assert time.monotonic() < deadline, complaint()
        time.sleep(every_s)
    return answer
