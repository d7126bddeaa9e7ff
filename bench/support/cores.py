"""CPU time of the whole machine, and of this process with its descendants."""

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
    """The cost of some work, once it is over."""

    wall_s: float = 0.0
    cpu_s: float = 0.0  #: of this process's descendants that ended meanwhile
    others: float = 0.0  #: share of the cores that all other work took, the host's included


@contextmanager
def timed() -> Iterator[Taken]:
    """Measure the context; the numbers are set when it is left."""
    taken = Taken()
    ours, all_, started = children_cpu_s(), machine_cpu_s(), time.monotonic()
    yield taken
    taken.wall_s = time.monotonic() - started
    taken.cpu_s = children_cpu_s() - ours
    taken.others = _share(machine_cpu_s() - all_ - taken.cpu_s, taken.wall_s)


@dataclass
class Others:
    """All work but that of this process and its descendants, once it is over."""

    share: float = 0.0  #: of the cores, the host's included


@contextmanager
def others_meanwhile() -> Iterator[Others]:
    """Measure other work during the context; its share is set when the context is left."""
    others = Others()
    started, ours, all_ = time.monotonic(), family_cpu_s(), machine_cpu_s()
    yield others
    cpu_s = machine_cpu_s() - all_ - (family_cpu_s() - ours)
    others.share = _share(cpu_s, time.monotonic() - started)


def _share(cpu_s: float, wall_s: float) -> float:
    return max(0.0, cpu_s) / (wall_s * (psutil.cpu_count() or 1))


def children_cpu_s() -> float:
    """Return the CPU seconds of this process's descendants that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def machine_cpu_s() -> float:
    """Return the CPU seconds that the machine has spent, or that its host withheld."""
    times = psutil.cpu_times()
    # Guests' time is part of the user's.
    idle = {"idle", "iowait", "guest", "guest_nice"}
    return float(sum(value for name, value in times._asdict().items() if name not in idle))


def family_cpu_s() -> float:
    """Return the CPU seconds of this process and all its descendants, alive or ended."""
    ours = psutil.Process()
    used = ours.cpu_times()
    spent = used.user + used.system + used.children_user + used.children_system
    for process in ours.children(recursive=True):
        with suppress(psutil.NoSuchProcess):  # it ended a moment ago
            times = process.cpu_times()
            spent += times.user + times.system
    return float(spent)
