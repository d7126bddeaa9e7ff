"""Runs `plateau render` as a user does, and looks at what its processes use meanwhile."""

from __future__ import annotations

import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import psutil

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

_ROOT = Path(__file__).parents[2]
_LOOK_EVERY_S = 0.25


@dataclass(frozen=True)
class Look:
    """CPU seconds that the farm's processes had used at one moment."""

    #: In seconds of `time.time`.
    at: float
    all_: float
    monitor: float


def render(
    scene: Path, out: Path, *, parameters: Mapping[str, object], options: Mapping[str, object]
) -> list[Look]:
    """Render a scene to its end, and return what the processes used on the way.

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
    command = [sys.executable, "-m", "plateau", "render", str(scene), "--out", str(out)]
    for name, value in options.items():
        command += [name] if value is True else [name, str(value)]
    command += [f"-D{name}={value}" for name, value in parameters.items()]
    looks = []
    with psutil.Popen(
        command, cwd=_ROOT, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL
    ) as process:
        while process.poll() is None:
            looks.append(_look(process))
            time.sleep(_LOOK_EVERY_S)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    return looks


def monitors_share(looks: Sequence[Look]) -> float:
    """Return the monitor's share of the CPU time between the first look and the last."""
    first, last = looks[0], looks[-1]
    return (last.monitor - first.monitor) / (last.all_ - first.all_)


def _look(root: psutil.Process) -> Look:
    used = []
    for process in (root, *root.children(recursive=True)):
        with suppress(psutil.NoSuchProcess):  # it ended a moment ago
            times = process.cpu_times()
            used.append((times.user + times.system, "monitor" in process.cmdline()))
    return Look(
        at=time.time(),
        all_=sum(seconds for seconds, _ in used),
        monitor=sum(seconds for seconds, is_monitor in used if is_monitor),
    )
