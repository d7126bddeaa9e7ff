"""How much memory a process may have: the machine's, or that of the container or unit around it."""

import os
import resource
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Final

_GROUPS: Final = Path("/sys/fs/cgroup")
#: Where control groups are, and the name of the file with their limit, by the kernel's name of the
#: hierarchy: that of version 2, and the one for memory of version 1.
_LIMITS: Final = {
    "": (_GROUPS, "memory.max"),
    "memory": (_GROUPS / "memory", "memory.limit_in_bytes"),
}


@cache
def memory_bytes() -> int:
    """Return the least of the machine's memory, the control groups' limits and ``ulimit -d``."""
    machine = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    soft, _ = resource.getrlimit(resource.RLIMIT_DATA)
    own = machine if soft == resource.RLIM_INFINITY else soft
    return min(machine, own, *_of_groups())


def memory_left() -> float:
    """Return the bytes that this process may still take; infinite where no system tells."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return float("inf")
    return memory_bytes() - pages * os.sysconf("SC_PAGE_SIZE")


def _of_groups() -> Iterator[int]:
    """Yield the limits of this process's control groups; source: cgroups(7)."""
    with suppress(OSError):
        for line in Path("/proc/self/cgroup").read_text().splitlines():
            _, hierarchy, path = line.split(":", 2)
            if hierarchy in _LIMITS:
                folder, name = _LIMITS[hierarchy]
                own = Path(path.strip("/"))
                for group in (own, *own.parents):
                    with suppress(OSError, ValueError):  # "max", or outside of this container
                        yield int((folder / group / name).read_text())
