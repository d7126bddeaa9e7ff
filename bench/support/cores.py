"""CPU time: what the whole machine spends, and what a family of processes does."""

from __future__ import annotations

from contextlib import suppress

import psutil


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
