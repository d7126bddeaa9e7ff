"""CPU time: what the whole machine spends, and what a family of processes does."""

from __future__ import annotations

import resource
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import psutil

if TYPE_CHECKING:
    from collections.abc import Iterator


@dataclass
class Taken:
    """What a stretch of work took, once it is over."""

    wall_s: float = 0.0
    cpu_s: float = 0.0  #: of this process's children that ended meanwhile, and theirs
    #: How much of the cores everything else took meanwhile, this machine's host included.
    others: float = 0.0


@contextmanager
def timed() -> Iterator[Taken]:
    """Yield what the context takes; its numbers are there when it is left."""
    taken = Taken()
    ours, all_, started = children_cpu_s(), machine_cpu_s(), time.monotonic()
    yield taken
    taken.wall_s = time.monotonic() - started
    taken.cpu_s = children_cpu_s() - ours
    taken.others = _share(machine_cpu_s() - all_ - taken.cpu_s, taken.wall_s)


@dataclass
class Others:
    """What everything but this process and all below it did, once that is over."""

    share: float = 0.0  #: of the cores, this machine's host included


@contextmanager
def others_meanwhile() -> Iterator[Others]:
    """Yield what other work does in the context; its share is there when the context is left."""
    others = Others()
    started, ours, all_ = time.monotonic(), family_cpu_s(), machine_cpu_s()
    yield others
    cpu_s = machine_cpu_s() - all_ - (family_cpu_s() - ours)
    others.share = _share(cpu_s, time.monotonic() - started)


def _share(cpu_s: float, wall_s: float) -> float:
    return max(0.0, cpu_s) / (wall_s * (psutil.cpu_count() or 1))


def children_cpu_s() -> float:
    """Return the CPU seconds of this process's children that have ended, and of theirs."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def machine_cpu_s() -> float:
    """Return the CPU seconds that the machine has spent on anything, or that its host withheld."""
    times = psutil.cpu_times()
    # Guests' time is part of the user's.
    idle = {"idle", "iowait", "guest", "guest_nice"}
    return float(sum(value for name, value in times._asdict().items() if name not in idle))


def family_cpu_s() -> float:
    """Return the CPU seconds of this process, of all below it that live, and of those it buried."""
    ours = psutil.Process()
    used = ours.cpu_times()
    spent = used.user + used.system + used.children_user + used.children_system
    for process in ours.children(recursive=True):
        with suppress(psutil.NoSuchProcess):  # it ended a moment ago
            times = process.cpu_times()
            spent += times.user + times.system
    return float(spent)
