"""What the bits that a worker renders depend on, beside the scene: libraries and the processor.

And what was found out about them, kept for as long as they stay the same.
"""

import contextlib
import hashlib
import json
import platform
import tempfile
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from plateau.farm.model import versions
from plateau.farm.model.renderers import renderers, variants
from plateau.worker.confinement import landlock
from plateau.worker.renderers.program import program_of

_PACKAGES: Final = ("drjit", "numpy")
#: Of the C library, whose functions scalar variants call.
_C_LIBRARY: Final = ("/libc.so", "/libm.so")


def of(libraries: Iterable[str]) -> dict[str, Any]:
    """Return all of it as JSON shows it, with these libraries."""
    files = sorted({*libraries, *_mapped(), *_programs()})
    return {
        "plateau": versions.plateau(),
        **{name: version(name) for name in _PACKAGES},
        **{
            one.package: version(one.package) if find_spec(one.package) else None
            for one in renderers().values()
            if one.package
        },
        "cpu": cpu(),
        "cpu flags": hashlib.sha256(_cpuinfo("flags").encode()).hexdigest(),
        "landlock": landlock.abi(),
        "libraries": [[path, stat.st_mtime_ns, stat.st_size] for path, stat in _stats(files)],
    }


class Memory:
    """What was found out about this machine, in a file; valid while the identity stays the same."""

    def __init__(self, file: Path, identity: Mapping[str, Any]) -> None:
        self.file = file
        self._identity = identity

    def read(self) -> Any:
        """Return what was written; None if there is nothing or it is no longer valid."""
        with contextlib.suppress(OSError, ValueError, TypeError, KeyError):
            content = json.loads(self.file.read_text(encoding="utf-8"))
            if content["identity"] == self._identity:
                return content["known"]
        return None  # an unreadable file counts as no file

    def write(self, known: object) -> None:
        """Write what JSON can say; without room for it, nothing is kept."""
        content = {"identity": self._identity, "known": known}
        with contextlib.suppress(OSError):
            self.file.parent.mkdir(parents=True, exist_ok=True)
            # Atomically: another worker may start at the same moment.
            with tempfile.NamedTemporaryFile(
                "w", dir=self.file.parent, delete=False, encoding="utf-8"
            ) as new:
                json.dump(content, new)
            Path(new.name).replace(self.file)


def cpu() -> str:
    """Return the processor's name."""
    return _cpuinfo("model name") or platform.processor() or platform.machine()


def _cpuinfo(field: str) -> str:
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith(field):
                return line.partition(":")[2].strip()
    return ""


def _programs() -> set[str]:
    """Return the programs that bring renderers."""
    return {str(program) for variant in variants() if (program := program_of(variant))}


def _mapped() -> set[str]:
    """Return the files of the C library that this process has loaded."""
    with contextlib.suppress(OSError):
        lines = Path("/proc/self/maps").read_text(encoding="utf-8").splitlines()
        paths = {line.split(maxsplit=5)[-1] for line in lines if "/" in line}
        return {path for path in paths if any(name in path for name in _C_LIBRARY)}
    return set()


def _stats(paths: Iterable[str]) -> list[tuple[str, Any]]:
    found = []
    for path in paths:
        with contextlib.suppress(OSError):
            found.append((path, Path(path).stat()))
    return found
