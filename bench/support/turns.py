"""Process trees that run in turns, so that a machine that slows down slows them alike.

The speed of a virtual machine drifts. Two runs of a minute, one after the other, then differ by
more than is to be measured. So both are alive at once and run in turns of some seconds,
stopped (SIGSTOP) in between; the clock of each counts its own turns only.
"""

from __future__ import annotations

import signal
import time
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import psutil

from bench.support.cores import children_cpu_s

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

#: Short compared with the drift, and long compared with what a stop costs. That is more than a
#: change of turns: a render child that is stopped in a chunk takes it for slow, and makes the next
#: ones smaller.
TURN_S: Final = 4.0
_POLL_EVERY_S: Final = 0.005
_LOOK_EVERY_S: Final = 0.5


@dataclass
class Ran:
    """The turns of a process tree and its CPU time, once it has ended."""

    turns: list[tuple[float, float]] = field(default_factory=list)  #: start and end, `time.time`
    cpu_s: float = 0.0

    def own_s(self, until: float = float("inf")) -> float:
        """Return the seconds of its turns before a moment of `time.time`."""
        return sum(max(0.0, min(end, until) - start) for start, end in self.turns)


def take_turns(
    processes: Mapping[str, psutil.Popen],
    turn_s: float = TURN_S,
    *,
    look: Callable[[], None] = lambda: None,
) -> dict[str, Ran]:
    """Let processes, each with its descendants, run in turns until all have ended.

    Parameters
    ----------
    processes
        Newly started processes by name, in the order of their turns.
    turn_s
        Seconds of a turn.
    look
        Called twice a second and between turns, whoever's turn it is: so all pay for it alike.

    Raises
    ------
    ChildProcessError
        One failed; all others are killed.
    """
    ran = {name: Ran() for name in processes}
    trees = {name: _Tree(process) for name, process in processes.items()}
    try:
        for tree in trees.values():
            tree.stop()
        while trees:
            for name, tree in list(trees.items()):
                buried_cpu_s = children_cpu_s()
                started = time.time()
                tree.go_on()
                status = tree.status(turn_s, look)
                ended = tree.stop() if status is None else time.time()
                ran[name].turns.append((started, ended))
                if status is None:
                    look()
                    continue
                ran[name].cpu_s = children_cpu_s() - buried_cpu_s
                if status:
                    raise ChildProcessError(f"{name}: exit code {status}")
                del trees[name]
    finally:
        for tree in trees.values():
            tree.kill()
    return ran


class _Tree:
    """A process and its descendants.

    These are looked up after a turn, since that takes milliseconds: so a turn begins and ends for
    all of them at once.
    """

    def __init__(self, root: psutil.Popen) -> None:
        self._root = root
        self._members: list[psutil.Process] = [root]

    def go_on(self) -> None:
        self._signal(self._members, signal.SIGCONT)

    def stop(self) -> float:
        """Stop all; return when those known at the start of the turn had stopped."""
        self._signal(self._members, signal.SIGSTOP)
        stopped_at = time.time()
        while born := [one for one in self._below() if one not in self._members]:
            self._signal(born, signal.SIGSTOP)
            self._members += born
        self._members = [self._root, *(one for one in self._members[1:] if one.is_running())]
        return stopped_at

    def status(self, within_s: float, look: Callable[[], None]) -> int | None:
        """Return the root's exit code once it ends; None if it still runs after `within_s`."""
        began = looked = time.monotonic()
        status: int | None = None
        while status is None and time.monotonic() < began + within_s:
            time.sleep(_POLL_EVERY_S)
            if time.monotonic() >= looked + _LOOK_EVERY_S:
                look()
                looked = time.monotonic()
            status = self._root.poll()
        return status

    def kill(self) -> None:
        """Kill all processes."""
        self._signal([*self._members, *self._below()], signal.SIGKILL)
        self._root.wait()

    def _below(self) -> list[psutil.Process]:
        with suppress(psutil.NoSuchProcess):
            return self._root.children(recursive=True)
        return []

    @staticmethod
    def _signal(members: list[psutil.Process], number: signal.Signals) -> None:
        for one in members:
            with suppress(psutil.NoSuchProcess):  # it ended a moment ago
                one.send_signal(number)
