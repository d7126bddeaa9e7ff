"""Confines a render child, so that a hostile scene in it can do little.

Resource limits bound its memory, its open files and the files that it writes; the supervisor bounds
its time. Four measures then protect all other processes of the machine, its supervisor first:

- Root's capabilities are dropped.
- Landlock leaves it Python, Mitsuba, the system's libraries, the scenes (which it can open by name
  but not list) and one folder to write into, with the kernels that Dr.Jit compiles.
- Its memory is closed: no process of the same user can read it.
- A seccomp filter refuses other programs and processes, sockets, signals and the like.

All are applied before the child has a second thread and before it sees a scene. A child that
becomes another program takes what holds for single threads before that, and all four measures
there. A measure that the kernel lacks is reported and left out. A scene that takes a child over
still reaches the scenes that this child is given, and the kernels that children share.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from plateau import farm
from plateau.farm.process.lifecycle import limit, shut_memory
from plateau.worker.confinement import gpus, landlock
from plateau.worker.confinement.capabilities import drop_capabilities
from plateau.worker.confinement.seccomp import refuse_calls

#: Where systems keep shared libraries, and lists of them.
_LIBRARIES: Final = (
    *("/lib", "/lib64", "/usr/lib", "/usr/lib64", "/usr/local/lib", "/nix/store", "/gnu/store"),
    "/etc/ld.so.cache",
    "/etc/ssl/openssl.cnf",  # Python's hashes read it
)

#: What the C library, LLVM and Embree ask of the machine: processors, memory, themselves.
_MACHINE: Final = (
    *("/proc/self", "/proc/cpuinfo", "/proc/meminfo", "/proc/stat", "/proc/sys/vm"),
    *("/sys/devices/system", "/dev/null", "/dev/zero", "/dev/urandom"),
)


def limit_resources(
    memory_bytes: int, open_files: int, file_bytes: int, *, on_gpu: bool = False
) -> None:
    """Bound what this process can use, from now on and for good.

    Parameters
    ----------
    memory_bytes : int
        Address space; 0 for no limit.
    open_files : int
        Files open at a time.
    file_bytes : int
        Size of any file that it writes; more fails with ``EFBIG``: Python ignores ``SIGXFSZ``.
    on_gpu : bool
        Bound its own data in place of its address space, of which CUDA reserves 300 GB.
    """
    limit(resource.RLIMIT_CORE, 0)
    limit(resource.RLIMIT_NOFILE, open_files)
    limit(resource.RLIMIT_FSIZE, file_bytes)
    if memory_bytes:
        limit(resource.RLIMIT_DATA if on_gpu else resource.RLIMIT_AS, memory_bytes)


@dataclass(frozen=True)
class Measure:
    """One of the measures that confine a render child."""

    name: str
    holds: str  #: what it ensures
    error: str | None  #: why it could not be applied; None if it was


def confine(*, scenes: Iterable[Path], kernels: Path, on_gpu: bool = False) -> tuple[Measure, ...]:
    """Confine this process, for good; return each measure, applied or not.

    Call it before other threads start: Landlock and capabilities hold for one thread each.

    Parameters
    ----------
    scenes : iterable of Path
        Folders in which scenes lie.
    kernels : Path
        The folder of the kernels that Dr.Jit has compiled; it has to exist.
    on_gpu : bool
        Whether it may use this machine's GPUs.
    """
    devices = gpus.driver_files() if on_gpu else ()
    files = f"libraries, scenes by name and its kernels alone (Landlock, ABI {landlock.abi()})"
    calls = "no programs, processes, signals or sockets (seccomp)"
    return (
        _take("capabilities", "root's are gone", drop_capabilities),
        _take("memory", "other processes cannot look into it", shut_memory),
        _take("files", files, lambda: landlock.restrict((*_allowed(scenes, kernels), *devices))),
        _take("system calls", calls, lambda: refuse_calls(but_packets=on_gpu)),
    )


def confine_before(program: Path, *, scenes: Iterable[Path], kernels: Path) -> None:
    """Confine this process as far as it can be before it becomes a program, which then confines it.

    The program has threads by then, for which Landlock and capabilities would not hold.

    Parameters
    ----------
    program : Path
        The program itself; nothing else can be run.
    scenes, kernels
        As of `confine`.
    """
    _take("capabilities", "", drop_capabilities)
    allowed = (
        *_allowed(scenes, kernels),
        *((folder, landlock.READ) for folder in _folders_of(program)),
        *((one, landlock.RUN) for one in (program, *map(Path, _LIBRARIES))),
    )
    _take("files", "", lambda: landlock.restrict(allowed))


def try_here() -> tuple[Measure, ...]:
    """Return what `confine` achieves on this machine, tried in a process of its own."""
    with tempfile.TemporaryDirectory() as kernels:
        done = subprocess.run(
            [sys.executable, "-s", "-m", "plateau.worker.confinement.confine", kernels],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            encoding="utf-8",
            check=True,
        )
    return tuple(Measure(**one) for one in json.loads(done.stdout))


def _take(name: str, holds: str, measure: Callable[[], None]) -> Measure:
    try:
        measure()
    except OSError as error:
        return Measure(name, holds, error.strerror or str(error))
    return Measure(name, holds, None)


def _allowed(scenes: Iterable[Path], kernels: Path) -> Iterator[tuple[Path, int]]:
    """Yield the paths that may be opened, each with its rights."""
    system = map(Path, (*_LIBRARIES, *_MACHINE))
    for path in (*_python(), *system, *_named_libraries(), *_program()):
        yield path, landlock.READ
    for folder in scenes:
        yield folder, landlock.OPEN
    yield kernels, landlock.KEEP_FILES
    yield Path("/dev/null"), landlock.KEEP_FILES


def _python() -> Iterator[Path]:
    """Yield the folders of modules, save the working folder, which may be anyone's."""
    # `python -m` puts it first, unless it is told otherwise.
    working = None if getattr(sys.flags, "safe_path", False) else sys.path[0]
    yield from (Path(one) for one in sys.path if one not in ("", working))
    yield Path(farm.__path__[0]).parent


def _program() -> Iterator[Path]:
    """Yield what the program reads that this process runs, if that is not Python itself."""
    running = Path("/proc/self/exe").resolve()
    if running != Path(sys.executable).resolve():
        yield from _folders_of(running)


def _folders_of(program: Path) -> Iterator[Path]:
    """Yield the folders that a program reads beside the system's libraries.

    A release may be one folder, with the program in it. An installed program has its files in
    ``share`` and ``lib``, beside its ``bin``.
    """
    beside = program.parent.parent
    yield from (
        (beside / "share" / program.name, beside / "lib")
        if program.parent.name == "bin"
        else (program.parent,)
    )


def _named_libraries() -> Iterator[Path]:
    """Yield the library folders that Python or the environment names."""
    yield Path(sys.base_prefix) / "lib"
    yield Path(sys.prefix) / "lib"
    yield from (Path(one) for one in os.environ.get("LD_LIBRARY_PATH", "").split(":") if one)
    if llvm := os.environ.get("DRJIT_LIBLLVM_PATH"):
        yield Path(llvm).resolve().parent


if __name__ == "__main__":
    print(json.dumps([asdict(one) for one in confine(scenes=(), kernels=Path(sys.argv[1]))]))
