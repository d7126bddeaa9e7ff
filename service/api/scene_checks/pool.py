"""Checks of scenes: each in a process with limits, two at a time, and for nobody who has gone.

A check reads what a stranger sent. `plateau.farm.bundle` bounds what that costs, and the kernel
bounds what `plateau.farm.bundle` overlooks: CPU time and memory by limits of the process
(`plateau.service.api.scene_checks.child`), time by a deadline. So the API never reads a scene
itself.

A process serves one check after another, since to start one takes a tenth of a second.
"""

import asyncio
import math
import threading
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any, BinaryIO, Final, TypeVar

from plateau.farm.bundle import BundleError, BundleLimits, SceneSummary
from plateau.service.api.scene_checks.process import Asked, CheckBudget, CheckProcess

#: So many are made at a time, and so many more may wait for their turn.
_AT_A_TIME: Final = 2
MOST_WAITING: Final = 16
#: For so long one waits for its turn, in seconds.
_PATIENCE_S: Final = 20.0
#: So often a client is asked whether it is still there, in seconds.
_ASKED_EVERY_S: Final = 0.25
_BUDGET: Final = CheckBudget()

T = TypeVar("T")
#: Whether who asked has gone.
IsGone = Callable[[], Awaitable[bool]]


class TooManyChecks(Exception):
    """So many checks wait that one more would take too long."""


class Gone(Exception):
    """Nobody waits for the check any more."""


@dataclass
class Checked:
    """What a check found."""

    summary: SceneSummary | None  #: with the first values; None where these are refused
    sizes: list[tuple[int, int]]  #: width and height in pixels, with each values up to the error
    error: BundleError | None  #: what is wrong with the values after those

    @classmethod
    def of(cls, answer: dict[str, Any]) -> "Checked":
        """What a process has answered."""
        summary = None if "summary" not in answer else SceneSummary(**answer["summary"])
        checked = cls(summary, [], None)
        checked.add(answer)
        return checked

    def add(self, answer: dict[str, Any]) -> None:
        """Take in what a process has answered about the values that follow."""
        self.sizes += [(width, height) for width, height in answer["sizes"]]
        if "error" in answer:
            self.error = BundleError.told(**answer["error"])


class SceneChecks:
    """Makes the checks of one API.

    Parameters
    ----------
    limits
        What a scene may be.
    budget
        What a check may cost.
    """

    def __init__(self, limits: BundleLimits, budget: CheckBudget = _BUDGET) -> None:
        self.limits = limits
        self._budget = budget
        self._threads = ThreadPoolExecutor(_AT_A_TIME, thread_name_prefix="scene-checks")
        self._turns = asyncio.Semaphore(_AT_A_TIME)
        self._admitted = 0
        self._all = tuple(CheckProcess(budget) for _ in range(_AT_A_TIME))
        self._idle = list(self._all)

    def warm_up(self) -> None:
        """Start the first process, so that the first check need not wait for it."""
        self._threads.submit(self._idle[-1].start)

    def close(self) -> None:
        """End the processes, and so what they do."""
        for process in self._all:
            process.kill()
        self._threads.shutdown(cancel_futures=True)
        for process in self._all:
            process.end()

    @asynccontextmanager
    async def turn(self, is_gone: IsGone) -> AsyncIterator["Turn"]:
        """A turn to check something, for who is told to have gone where nobody waits for it.

        Raises
        ------
        TooManyChecks
            Sixteen wait already, or have gone ahead for twenty seconds.
        Gone
            Nobody waits for it any more.
        """
        if self._admitted >= _AT_A_TIME + MOST_WAITING:
            raise TooManyChecks
        self._admitted += 1
        try:
            turn = Turn(self, is_gone)
            await self.begin(is_gone, patience_s=_PATIENCE_S)
            try:
                yield turn
            finally:
                if not turn.is_over:
                    self.end()
        finally:
            self._admitted -= 1

    async def begin(self, is_gone: IsGone, *, patience_s: float) -> None:
        """Wait for a turn."""
        begun = asyncio.ensure_future(self._turns.acquire())
        try:
            await _attend(begun, is_gone, patience_s=patience_s)
        except BaseException:
            if not begun.cancel():  # it came a moment ago
                self.end()
            raise

    def end(self) -> None:
        """Let the next have its turn."""
        self._turns.release()

    async def ask(self, file: BinaryIO, asked: Sequence[Asked], is_gone: IsGone) -> dict[str, Any]:
        """What a process answers that checks the file with as many values as a turn allows."""
        process, given_up = self._idle.pop(), threading.Event()
        work = asyncio.get_running_loop().run_in_executor(
            self._threads, process.ask, file, asked, self.limits, given_up
        )
        try:
            return await _attend(work, is_gone)
        finally:
            try:
                if not work.done():
                    given_up.set()
                    process.kill()
                    await asyncio.wait([work])
                    work.exception()  # it was ended: nobody need be told
            finally:
                self._idle.append(process)


class Turn:
    """The right to check something, now."""

    def __init__(self, checks: SceneChecks, is_gone: IsGone) -> None:
        self._checks = checks
        self._is_gone = is_gone
        self.is_over = False  #: given away, and not had back

    async def check(self, file: BinaryIO, asked: Sequence[Asked], *, total_s: float) -> Checked:
        """What is found in an upload with each of these values, until one is refused.

        Others have their turn in between. There are fewer answers than `asked` has values, and no
        error, where `total_s` seconds of CPU time are over.

        Raises
        ------
        BundleError
            The check takes more than it may, whatever the values.
        CheckEnded
            Somebody ended the process that checks.
        Gone
            Nobody waits for it any more.
        """
        answer = await self._checks.ask(file, asked, self._is_gone)
        checked, spent_s = Checked.of(answer), answer["cpu_s"]
        while checked.error is None and len(checked.sizes) < len(asked) and spent_s < total_s:
            await self._give_way()
            answer = await self._checks.ask(file, asked[len(checked.sizes) :], self._is_gone)
            checked.add(answer)
            spent_s += answer["cpu_s"]
        return checked

    async def _give_way(self) -> None:
        self._checks.end()
        self.is_over = True
        await self._checks.begin(self._is_gone, patience_s=math.inf)
        self.is_over = False


async def _attend(work: "asyncio.Future[T]", is_gone: IsGone, patience_s: float = math.inf) -> T:
    """What the work comes to, while somebody waits for it."""
    started = time.monotonic()
    while not (await asyncio.wait([work], timeout=_ASKED_EVERY_S))[0]:
        if await is_gone():
            raise Gone
        if time.monotonic() - started > patience_s:
            raise TooManyChecks
    return await work
