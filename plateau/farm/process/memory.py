"""How much memory a process may have: the machine's, or that of the container or unit around it."""

import os
import resource
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Final

_GROUPS: Final = Path("/sys/fs/cgroup")
_RESIDENT: Final = Path("/proc/self/statm")
#: Where control groups are, and the name of the file with their limit, by the kernel's name of the
#: hierarchy: that of version 2, and the one for memory of version 1.
_LIMITS: Final = {
    "": (_GROUPS, "memory.max"),
    "memory": (_GROUPS / "memory", "memory.limit_in_bytes"),
}


@cache
def memory_bytes() -> int:
    """Return the least of the machine's memory, the control groups' limits and ``ulimit -d``."""
    machine = os.sysconf("SC_PHYS_PAGES") * resource.getpagesize()
    soft, _ = resource.getrlimit(resource.RLIMIT_DATA)
    own = machine if soft == resource.RLIM_INFINITY else soft
    return min(machine, own, *_of_groups())


def memory_left() -> int:
    """Return the bytes that this process may still take."""
    return memory_bytes() - resident_bytes()


def resident_bytes() -> int:
    """Return this process's resident memory; 0 if the system does not tell."""
    if not _RESIDENT.exists():
        return 0
    return int(_RESIDENT.read_text(encoding="utf-8").split()[1]) * resource.getpagesize()


def _of_groups() -> Iterator[int]:
    """Yield the limits of this process's control groups; source: cgroups(7)."""
    with suppress(OSError):
        for line in Path("/proc/self/cgroup").read_text(encoding="utf-8").splitlines():
            _, hierarchy, path = line.split(":", 2)
            if hierarchy in _LIMITS:
                folder, name = _LIMITS[hierarchy]
                own = Path(path.strip("/"))
                for group in (own, *own.parents):
                    with suppress(OSError, ValueError):  # "max", or outside of this container
                        yield int((folder / group / name).read_text(encoding="utf-8"))
