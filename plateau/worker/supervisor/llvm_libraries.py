"""Finds the LLVM shared libraries of this machine, the newest first."""

import glob
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

#: Where distributions, Homebrew and conda put libLLVM. The linker's own list is read as well.
_PATTERNS = (
    "/usr/lib/llvm-*/lib/libLLVM*",
    "/usr/lib/*-linux-gnu/libLLVM*",
    "/usr/lib64/libLLVM*",
    "/usr/lib64/llvm*/lib*/libLLVM*",
    "/usr/lib/libLLVM*",
    "/usr/local/lib/libLLVM*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM*",
    "/usr/local/opt/llvm*/lib/libLLVM*",
    f"{sys.prefix}/lib/libLLVM*",
)

#: libLLVM.so.19.1, libLLVM-15.so.1, libLLVM.dylib; not libLLVM-C.so or libLLVMSPIRVLib.so.
_NAME = re.compile(r"libLLVM(-\d+)?(\.so|\.dylib)[.\d]*")

#: The version in a file's name, or else in its folder's: llvm-19, llvm@19, llvm/19.1.7.
_VERSIONS = (
    re.compile(r"libLLVM(?:-|\.so\.)(\d+)(?:\.(\d+))?"),
    re.compile(r"llvm[-@/](\d+)(?:\.(\d+))?"),
)


def llvm_libraries() -> tuple[Path, ...]:
    """Return the real file of every libLLVM of this machine once, in the order of trial.

    The one that ``DRJIT_LIBLLVM_PATH`` names is first, whatever its version.
    """
    return in_order_of_trial(os.environ.get("DRJIT_LIBLLVM_PATH"), _found())


def in_order_of_trial(wanted: str | None, found: list[Path]) -> tuple[Path, ...]:
    """Return the real files of `wanted` and then of `found`, the newest first, each once."""
    newest_first = sorted(found, key=lambda path: (version(path), str(path)), reverse=True)
    first = [Path(wanted)] if wanted and Path(wanted).is_file() else []
    return tuple(dict.fromkeys(path.resolve() for path in (*first, *newest_first)))


def version(library: Path) -> tuple[int, int]:
    """Return an LLVM library's (major, minor) by its real file's path; (0, 0) if it has none."""
    path = str(library.resolve())
    for pattern in _VERSIONS:
        match = pattern.search(path)
        if match:
            return int(match[1]), int(match[2] or 0)
    return 0, 0


def _found() -> list[Path]:
    paths = [path for pattern in _PATTERNS for path in glob.glob(pattern)]  # noqa: PTH207 (absolute)
    paths += [path for name, path in system_libraries() if name.startswith("libLLVM")]
    return [Path(path) for path in paths if _NAME.fullmatch(Path(path).name)]


def system_libraries() -> list[tuple[str, str]]:
    """Return (name, path) of each library in the dynamic linker's list; none without a list."""
    ldconfig = shutil.which("ldconfig") or shutil.which("ldconfig", path="/sbin:/usr/sbin")
    if ldconfig is None:
        return []
    listing = subprocess.run(
        [ldconfig, "-p"], capture_output=True, encoding="utf-8", check=False
    ).stdout
    return re.findall(r"^\s*(\S+) \(.*\) => (\S+)$", listing, re.MULTILINE)
