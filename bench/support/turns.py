"""Process trees that run in turns: a machine that slows down for a while slows each alike.

Two runs of a minute each, one after the other, differ by more than what is to be measured where the
machine's speed drifts, as that of a virtual one does. So both live at once, and run and are stopped
(SIGSTOP) in turns of a fraction of a second; each has a time of its own, that of its turns.
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

#: Long beside what a turn's change takes (some milliseconds), short beside a machine's moods.
TURN_S: Final = 0.5
_LOOK_EVERY_S: Final = 0.005


@dataclass
class Ran:
    """What a process tree had, once it has ended."""

    #: Its turns, from when to when, in seconds of `time.time`.
    turns: list[tuple[float, float]] = field(default_factory=list)
    #: CPU seconds of the tree.
    cpu_s: float = 0.0

    def own_s(self, until: float = float("inf")) -> float:
        """Return how many seconds of its turns lie before a moment of `time.time`."""
        return sum(max(0.0, min(end, until) - start) for start, end in self.turns)


def take_turns(
    processes: Mapping[str, psutil.Popen],
    turn_s: float = TURN_S,
    *,
    after_turn: Callable[[str], None] = lambda _name: None,
) -> dict[str, Ran]:
    """Let processes, each with all below it, run in turns until all have ended.

    Parameters
    ----------
    processes
        By name, in the order of their turns; just started.
    turn_s
        How long a turn is.
    after_turn
        Called with its name after the turn of one that has not ended.

    Raises
    ------
    ChildProcessError
        One failed. All are killed then.
    """
    ran = {name: Ran() for name in processes}
    living = dict(processes)
    try:
        for process in processes.values():
            _signal(process, signal.SIGSTOP)
        while living:
            for name, process in list(living.items()):
                buried_cpu_s = children_cpu_s()
                started = time.time()
                _signal(process, signal.SIGCONT)
                ended = _has_ended(process, turn_s)
                if not ended:
                    _signal(process, signal.SIGSTOP)
                ran[name].turns.append((started, time.time()))
                if not ended:
                    after_turn(name)
                    continue
                ran[name].cpu_s = children_cpu_s() - buried_cpu_s
                if process.returncode:
                    raise ChildProcessError(f"{name}: exit code {process.returncode}")
                del living[name]
    finally:
        for process in living.values():
            _signal(process, signal.SIGKILL)
            process.wait()
    return ran


def _has_ended(process: psutil.Popen, within_s: float) -> bool:
    deadline = time.monotonic() + within_s
    while process.poll() is None:
        if time.monotonic() > deadline:
            return False
        time.sleep(_LOOK_EVERY_S)
    return True


def _signal(root: psutil.Process, number: signal.Signals) -> None:
    """Send it to the whole tree, from the top down; what was just started must have it too."""
    reached: set[int] = set()
    while True:
        family = [root]
        with suppress(psutil.NoSuchProcess):
            family += root.children(recursive=True)
        new = [one for one in family if one.pid not in reached]
        if not new:
            return
        for one in new:
            reached.add(one.pid)
            with suppress(psutil.NoSuchProcess):
                one.send_signal(number)
