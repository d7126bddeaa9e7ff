"""Runs `plateau render` as a user does, and looks at what its processes use meanwhile."""

from __future__ import annotations

import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING

import psutil

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

_ROOT = Path(__file__).parents[2]


@dataclass(frozen=True, kw_only=True)
class Look:
    """CPU seconds that the farm's processes had used at one moment."""

    at: float  #: in seconds of `time.time`
    all_: float
    monitor: float


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


def look(root: psutil.Process) -> Look:
    """Return what `plateau render` and all below it that lives have used."""
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


def monitors_share(looks: Sequence[Look], start: float, end: float) -> float:
    """Return the monitor's share of the CPU time, from the look before a moment to that after."""
    looks = [one for one in looks if one.monitor]  # it ends before the others do
    first = max((one for one in looks if one.at <= start), key=attrgetter("at"), default=looks[0])
    last = min((one for one in looks if one.at >= end), key=attrgetter("at"), default=looks[-1])
    return (last.monitor - first.monitor) / (last.all_ - first.all_)
