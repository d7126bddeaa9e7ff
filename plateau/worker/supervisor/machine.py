"""The load of this machine, its memory and temperature, and the disk of the worker's cache."""

import shutil
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final, Protocol

import psutil

from plateau.farm.process.memory import memory_bytes

#: The sensors of processors, by the names that Linux and FreeBSD have for them.
_OF_PROCESSORS: Final = ("coretemp", "k10temp", "zenpower", "cpu_thermal", "cpu-thermal")


class Reading(Protocol):
    """What a sensor says."""

    @property
    def current(self) -> float:
        """The temperature in °C."""


def hottest(sensors: Mapping[str, Iterable[Reading]]) -> float | None:
    """The highest temperature of a processor, in °C; None without a sensor in one."""
    found = [one.current for name in _OF_PROCESSORS for one in sensors.get(name, ())]
    return max(found, default=None)


def memory_for_children() -> float:
    """Bytes of memory for the render children of this machine's workers, without a limit."""
    return 0.8 * memory_bytes()


class MachineUse:
    """How this machine is used."""

    def __init__(self, cache: Path) -> None:
        self._cache = cache
        self._devices: dict[str, float | None] = {}
        psutil.cpu_percent()  # the load is counted from here on

    def look_at_devices(self) -> None:
        """Note what is left of the disk, and the temperature.

        A device may not answer, so this is for the thread that renders, not the heartbeat.
        """
        with suppress(OSError):  # the next slice will meet the same error
            usage = shutil.disk_usage(self._cache)
            self._devices |= {"disk_bytes": usage.total, "disk_free_bytes": usage.free}
        # Not every system has the function.
        sensors = getattr(psutil, "sensors_temperatures", dict)
        with suppress(OSError):
            self._devices["temperature_c"] = hottest(sensors())

    def now(self) -> dict[str, object]:
        """Return the fields of `plateau.farm.model.worker.Machine`; asks no device."""
        memory = psutil.virtual_memory()
        return {
            "cores": psutil.cpu_count() or 1,
            "load": round(psutil.cpu_percent() / 100, 3),
            "memory_bytes": memory.total,
            "memory_used_bytes": memory.total - memory.available,
            **self._devices,
        }
