"""Starts the process of a render child, with the resources that it may use."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

from plateau.farm.images.channels import MOST_VALUES
from plateau.farm.model.renderers import variant_named
from plateau.farm.process.lifecycle import die_with_parent, plain_environment
from plateau.worker.supervisor import gpus

#: The films of a slice: its first pass and its sum, in float32.
_LARGEST_FILMS_BYTES: Final = 2 * MOST_VALUES * 4

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


class Inherited(NamedTuple):
    """The descriptors that a child has of its supervisor."""

    socket: int
    films: int
    words: int  #: for what it prints


def start(
    inherited: Inherited,
    variant: str,
    llvm_library: str | None,
    limits: ChildLimits,
    home: Path,
    scenes: Iterable[Path],
) -> subprocess.Popen[bytes]:
    """Start a child, the leader of a process group of its own; it dies with this process."""
    kernels = home / ".drjit"  # where Dr.Jit keeps them, and all that the child writes into
    kernels.mkdir(parents=True, exist_ok=True)
    environment = plain_environment()
    if variant_named(variant).on_gpu:
        environment |= gpus.environment()
    environment["HOME"] = str(home.absolute())
    environment["TMPDIR"] = str(kernels.absolute())
    if llvm_library is not None:
        environment["DRJIT_LIBLLVM_PATH"] = llvm_library
    return subprocess.Popen(
        [
            sys.executable,
            "-s",  # that home has no modules
            "-m",
            "plateau.worker.child",
            f"--socket={inherited.socket}",
            f"--films={inherited.films}",
            f"--variant={variant}",
            f"--threads={limits.threads}",
            f"--memory-bytes={limits.memory_bytes}",
            f"--open-files={limits.open_files}",
            f"--file-bytes={limits.file_bytes}",
            f"--kernels={kernels.absolute()}",
            *(f"--scenes={folder.absolute()}" for folder in scenes),
        ],
        env=environment,
        pass_fds=[inherited.socket, inherited.films],
        stdin=subprocess.DEVNULL,
        stdout=inherited.words,
        stderr=inherited.words,
        start_new_session=True,
        preexec_fn=_below_others(),
    )


def _below_others() -> Callable[[], None]:
    """Return what a child runs before its program, so that it holds for all threads."""
    arrange = die_with_parent(signal.SIGKILL)

    def before_the_program() -> None:
        arrange()
        # Slurm and systemd send it to every process of a worker that is to stop. The supervisor
        # ends its child itself; a child that went first would look as if the scene had killed it.
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        os.nice(NICE)

    return before_the_program
