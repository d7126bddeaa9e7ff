"""Runs `plateau render` as a user does."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import psutil

if TYPE_CHECKING:
    from collections.abc import Mapping

_ROOT = Path(__file__).parents[2]


def render(
    scene: Path, out: Path, *, parameters: Mapping[str, object], options: Mapping[str, object]
) -> None:
    """Render a scene to its end.

    Parameters
    ----------
    scene
        A folder or a file, as on the command line.
    out
        Where the results go.
    parameters
        Values of the scene's ``$parameters``.
    options
        Of the command, ``--step`` say; where the value is True, without one.

    Raises
    ------
    subprocess.CalledProcessError
        The command failed; why is on standard error.
    """
    with start(scene, out, parameters=parameters, options=options) as process:
        if process.wait():
            raise subprocess.CalledProcessError(process.returncode, process.args)


def start(
    scene: Path, out: Path, *, parameters: Mapping[str, object], options: Mapping[str, object]
) -> psutil.Popen:
    """Start to render a scene; see `render`."""
    command = [sys.executable, "-m", "plateau", "render", str(scene), "--out", str(out)]
    for name, value in options.items():
        command += [name] if value is True else [name, str(value)]
    command += [f"-D{name}={value}" for name, value in parameters.items()]
    return psutil.Popen(command, cwd=_ROOT, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
