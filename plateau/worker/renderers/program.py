"""A program that brings its own Python and a renderer's package.

Where this Python lacks the package, such a program on the PATH can run the same modules of Plateau
in its place. Both Pythons have to be of one version, as OpenEXR's library is compiled for one.
"""

import contextlib
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Final, NoReturn

from plateau.farm.model.renderers import renderer_of

#: The longest that a program may take to say its version.
_VERSION_S: Final = 60.0


def program_of(variant: str) -> Path | None:
    """Return the program that brings a variant's renderer; None if this Python has it, or nobody.

    In the program itself, this Python has it.
    """
    renderer = renderer_of(variant)
    if renderer.program is None or find_spec(renderer.package) is not None:
        return None
    found = shutil.which(renderer.program.name)
    return None if found is None else Path(found).resolve()


def release(variant: str) -> str:
    """Return the version of the package that has a variant's renderer, or of the program."""
    program = program_of(variant)
    if program is None:
        return version(renderer_of(variant).package)
    said = ""
    with contextlib.suppress(OSError, subprocess.SubprocessError):
        said = subprocess.check_output([program, "--version"], encoding="utf-8", timeout=_VERSION_S)
    found = re.search(r"\d+(\.\d+)+", said)
    return found[0] if found else "of an unknown version"


def command(variant: str, module: str, arguments: Sequence[str] = ()) -> list[str]:
    """Return the command that runs a module of Plateau where a variant's renderer is."""
    program, brought = program_of(variant), renderer_of(variant).program
    if program is None or brought is None:
        return [sys.executable, "-s", "-m", module, *arguments]
    return [
        str(program),
        *brought.arguments,
        "--",
        sysconfig.get_python_version(),
        *dict.fromkeys((sysconfig.get_path("purelib"), sysconfig.get_path("platlib"))),
        "--",
        module,
        *arguments,
    ]


def continue_in(variant: str, module: str) -> NoReturn:
    """Become the program, which runs a module with the arguments of this process."""
    whole = command(variant, module, sys.argv[1:])
    try:
        # It has a Python of its own, and no business with the one that is first on the PATH.
        os.execve(whole[0], whole, {**os.environ, "PATH": os.defpath})
    except OSError as error:
        sys.exit(
            f"{whole[0]} cannot be started ({error.strerror}): it has to be the program itself, "
            "not a script that starts it"
        )
