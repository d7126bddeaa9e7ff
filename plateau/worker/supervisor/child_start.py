"""Starts the process of a render child, with the resources that it may use."""

import os
import signal
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from plateau.farm.images.channels import MOST_VALUES
from plateau.farm.model.renderers import variant_named
from plateau.farm.model.spec.shared import MOST_INPUTS
from plateau.farm.process.child import Child
from plateau.farm.process.lifecycle import plain_environment
from plateau.worker.supervisor import gpus

#: The films of a slice: its sum, its first pass, and the sums of its inputs, in float32.
_LARGEST_FILMS_BYTES: Final = (2 + MOST_INPUTS) * MOST_VALUES * 4

#: How many files stay where Dr.Jit keeps its kernels, of some 20 kB each; the oldest go first.
_KERNELS: Final = 10_000

#: A render takes every core for hours. Processes that answer people need little of one, but soon.
#: Idle cores still go to the child.
NICE: Final = 10


@dataclass(frozen=True, kw_only=True)
class ChildLimits:
    """The resources that a render child may use."""

    threads: int
    memory_bytes: int  #: 0 for no limit
    timeout_s: float  #: to load a scene, or for a part of a pass while its pace is unknown
    open_files: int = 1024
    file_bytes: int = _LARGEST_FILMS_BYTES  #: of any file that it writes


def start_child(
    films: int,
    variant: str,
    llvm_library: str | None,
    limits: ChildLimits,
    home: Path,
    scenes: Iterable[Path],
) -> Child:
    """Start a child that inherits the file of this descriptor for its films."""
    kernels = home / ".drjit"  # where Dr.Jit keeps them, and all that the child writes into
    kernels.mkdir(parents=True, exist_ok=True)
    _forget_oldest(kernels)
    environment = plain_environment()
    if variant_named(variant).on_gpu:
        environment |= gpus.environment()
    environment["HOME"] = str(home.absolute())
    environment["TMPDIR"] = str(kernels.absolute())
    if llvm_library is not None:
        environment["DRJIT_LIBLLVM_PATH"] = llvm_library
    return Child(
        "plateau.worker.child",
        f"--films={films}",
        f"--variant={variant}",
        f"--threads={limits.threads}",
        f"--memory-bytes={limits.memory_bytes}",
        f"--open-files={limits.open_files}",
        f"--file-bytes={limits.file_bytes}",
        f"--kernels={kernels.absolute()}",
        *(f"--scenes={folder.absolute()}" for folder in scenes),
        environment=environment,
        pass_fds=[films],
        prepare=_below_others,
        user_site=False,  # that home has no modules
    )


def _forget_oldest(kernels: Path) -> None:
    if len(paths := tuple(kernels.iterdir())) > _KERNELS:
        ages = {}
        for path in paths:
            with suppress(OSError):  # another worker has removed it
                ages[path] = path.lstat().st_mtime_ns
        for path in sorted(ages, key=ages.__getitem__)[:-_KERNELS]:
            with suppress(OSError):
                path.unlink()


def _below_others() -> None:
    """Make way for others, before the program runs, so that it holds for all threads."""
    # Slurm and systemd send it to every process of a worker that is to stop. The supervisor
    # ends its child itself; a child that went first would look as if the scene had killed it.
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    os.nice(NICE)
