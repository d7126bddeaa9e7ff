"""The load of this machine, its memory, and the disk of the worker's cache."""

import shutil
from contextlib import suppress
from pathlib import Path

import psutil


class MachineUse:
    """How this machine is used."""

    def __init__(self, cache: Path) -> None:
        self._cache = cache
        self._disk: dict[str, int] = {}
        psutil.cpu_percent()  # the load is counted from here on

    def look_at_disk(self) -> None:
        """Note what is left of the disk.

        A disk may not answer, so this is for the thread that renders, and never for the heartbeat.
        """
        with suppress(OSError):  # the next slice will meet the same error
            usage = shutil.disk_usage(self._cache)
            self._disk = {"disk_bytes": usage.total, "disk_free_bytes": usage.free}

    def now(self) -> dict[str, object]:
        """Return the fields of `plateau.farm.model.worker.Machine`; reads no disk."""
        memory = psutil.virtual_memory()
        return {
            "cores": psutil.cpu_count() or 1,
            "load": round(psutil.cpu_percent() / 100, 3),
            "memory_bytes": memory.total,
            "memory_used_bytes": memory.total - memory.available,
            **self._disk,
        }
