"""The GPUs that a worker may use, and the driver by which Dr.Jit reaches them."""

import os
import shutil
import subprocess
from pathlib import Path
from typing import Final

from plateau.worker.supervisor.llvm_libraries import system_libraries

#: Which GPUs a process sees, and where Dr.Jit finds the driver. Slurm, Kubernetes and people set
#: them, and a render child keeps to them.
_VARIABLES: Final = (
    *("CUDA_VISIBLE_DEVICES", "CUDA_DEVICE_ORDER", "NVIDIA_VISIBLE_DEVICES"),
    *("HIP_VISIBLE_DEVICES", "ROCR_VISIBLE_DEVICES", "ZE_AFFINITY_MASK"),
    *("DRJIT_LIBCUDA_PATH", "DRJIT_LIBOPTIX_PATH"),
)
#: Where the driver of Windows is below WSL.
_WSL: Final = "/usr/lib/wsl/lib/libcuda.so.1"
#: Where Dr.Jit looks by itself.
_KNOWN_TO_DRJIT: Final = "/usr/lib/"
#: Memory in MiB that a card has free when CUDA, OptiX and a scene find room.
_ROOM_MIB: Final = 2048


def environment() -> dict[str, str]:
    """Return the variables that decide on GPUs, for a process that renders.

    Where only the dynamic linker knows the driver, one names it: Dr.Jit looks for it elsewhere.
    """
    given = {name: os.environ[name] for name in _VARIABLES if name in os.environ}
    driver = cuda_driver()
    if driver is not None and not str(driver).startswith(_KNOWN_TO_DRJIT):
        given.setdefault("DRJIT_LIBCUDA_PATH", str(driver))
    return given


def cuda_driver() -> Path | None:
    """Return the library of NVIDIA's driver; None where there is none."""
    named = Path(os.environ.get("DRJIT_LIBCUDA_PATH", _WSL))
    if named.exists():
        return named
    for name, path in system_libraries():
        if name.startswith("libcuda.so"):
            return Path(path)
    return None


def cards(*fields: str) -> list[list[str]]:
    """Return what NVIDIA's own program says of each GPU of this worker's; nothing without it.

    Parameters
    ----------
    *fields
        As ``nvidia-smi --query-gpu`` has them, such as ``memory.free``, which is in MiB.
    """
    program = shutil.which("nvidia-smi")
    if program is None:
        return []
    named = os.environ.get("CUDA_VISIBLE_DEVICES")
    command = [program, f"--query-gpu={','.join(fields)}", "--format=csv,noheader,nounits"]
    command += ["-i", named] if named else []
    try:
        done = subprocess.run(
            command, capture_output=True, encoding="utf-8", timeout=30, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return []
    return [line.split(", ") for line in done.stdout.splitlines()]


def uuids() -> list[str]:
    """Return the UUID of each NVIDIA GPU of this worker's."""
    return [one for [one] in cards("uuid") if one.startswith("GPU-")]


def of_worker(number: int) -> dict[str, str]:
    """Return the variable by which the workers of a machine take its GPUs in turn, if it has some.

    Dr.Jit renders on the first GPU that it sees.
    """
    found = uuids()
    return {"CUDA_VISIBLE_DEVICES": found[number % len(found)]} if len(found) > 1 else {}


def shortage() -> str | None:
    """Return which of the worker's GPUs has hardly any memory free, and what to do; else None.

    Whoever asks CUDA itself on a full card is ended by it.
    """
    for index, free, total in filter(_is_whole, cards("index", "memory.free", "memory.total")):
        if int(free) < _ROOM_MIB:
            return (
                f"GPU {index} has {free} of {total} MiB free: end what holds its memory "
                "(nvidia-smi lists it), or name another GPU in CUDA_VISIBLE_DEVICES"
            )
    return None


def _is_whole(card: list[str]) -> bool:
    """Return whether there are three numbers: a driver may not know some, or say an error."""
    return len(card) == 3 and all(field.isdecimal() for field in card)
