"""Checks of scenes: in processes with limits, two at a time, and only while the client waits.

A check reads untrusted input. `plateau.farm.bundle` bounds its cost. Limits on the process's CPU
time and memory (`plateau.service.api.scene_checks.child`) and a deadline bound what
`plateau.farm.bundle` overlooks. So the API never reads a scene itself.

A process serves one check after another, because starting one takes a tenth of a second.
"""

import asyncio
import math
import threading
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, BinaryIO, Final, TypeVar

from plateau.farm.bundle import BundleError, BundleLimits, SceneSummary
from plateau.service.api.scene_checks.process import Asked, CheckBudget, CheckProcess

_AT_A_TIME: Final = 2
#: Checks that may wait for their slot.
MOST_WAITING: Final = 16
#: The longest wait for a slot, in seconds.
_PATIENCE_S: Final = 20.0
#: Seconds between two checks whether a client is still connected.
_ASKED_EVERY_S: Final = 0.25
_BUDGET: Final = CheckBudget()

T = TypeVar("T")
#: Says whether the client has disconnected.
IsGone = Callable[[], Awaitable[bool]]


class TooManyChecks(Exception):
    """`MOST_WAITING` checks wait already, or this one has waited too long for its slot."""


class Gone(Exception):
    """The client has disconnected."""


@dataclass
class Checked:
    """The result of a check with several sets of values."""

    summary: SceneSummary | None  #: with the first set; None if that was refused
    #: width and height in pixels, for each set before the error; None where nobody can tell yet
    sizes: list[tuple[int | None, int | None]]
    error: BundleError | None  #: the error with the next set

    @classmethod
    def of(cls, answer: dict[str, Any]) -> "Checked":
        """Decode a process's answer."""
        return cls(
            summary=SceneSummary(**answer["summary"]) if "summary" in answer else None,
            sizes=[(width, height) for width, height in answer["sizes"]],
            error=BundleError.told(**answer["error"]) if "error" in answer else None,
        )


#: Checks an upload with sets of values, until one is refused or the budget is spent, without an
#: error. Raises as `CheckProcess.ask`, or `Gone`.
Check = Callable[[BinaryIO, Sequence[Asked]], Awaitable[Checked]]


class SceneChecks:
    """The checks of one API process: the limits on scenes, and a check's budget."""

    def __init__(self, limits: BundleLimits, budget: CheckBudget = _BUDGET) -> None:
        self.limits = limits
        self._threads = ThreadPoolExecutor(_AT_A_TIME, thread_name_prefix="scene-checks")
        self._slots = asyncio.Semaphore(_AT_A_TIME)
        self._admitted = 0
        self._all = tuple(CheckProcess(budget) for _ in range(_AT_A_TIME))
        self._idle = list(self._all)

    def warm_up(self) -> None:
        """Start the first process, so that the first check need not wait for it."""
        self._threads.submit(self._idle[-1].start)

    def close(self) -> None:
        """End the processes and their checks."""
        for process in self._all:
            process.kill()
        self._threads.shutdown(cancel_futures=True)
        for process in self._all:
            process.end()

    @asynccontextmanager
    async def slot(self, is_gone: IsGone) -> AsyncIterator[Check]:
        """Wait for a slot, which lasts as long as the context; raises `TooManyChecks` or `Gone`."""
        if self._admitted >= _AT_A_TIME + MOST_WAITING:
            raise TooManyChecks
        self._admitted += 1
        try:
            begun = asyncio.ensure_future(self._slots.acquire())
            try:
                await attend(begun, is_gone, patience_s=_PATIENCE_S)
            except BaseException:
                if not begun.cancel():  # the slot has just come
                    self._slots.release()
                raise
            try:
                yield partial(self._check, is_gone)
            finally:
                self._slots.release()
        finally:
            self._admitted -= 1

    async def _check(self, is_gone: IsGone, file: BinaryIO, asked: Sequence[Asked]) -> Checked:
        process, given_up = self._idle.pop(), threading.Event()
        work = asyncio.get_running_loop().run_in_executor(
            self._threads, process.ask, file, asked, self.limits, given_up
        )
        try:
            return Checked.of(await attend(work, is_gone))
        finally:
            try:
                if not work.done():
                    given_up.set()
                    process.kill()
                    await asyncio.wait([work])
                    work.exception()  # expected: the process was killed
            finally:
                self._idle.append(process)


async def attend(work: "asyncio.Future[T]", is_gone: IsGone, patience_s: float = math.inf) -> T:
    """Wait for the work while the client waits, and for `patience_s` at most."""
    started = time.monotonic()
    while not (await asyncio.wait([work], timeout=_ASKED_EVERY_S))[0]:
        if await is_gone():
            raise Gone
        if time.monotonic() - started > patience_s:
            raise TooManyChecks
    return await work
