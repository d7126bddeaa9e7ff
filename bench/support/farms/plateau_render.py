"""Runs `plateau render` as a user does, and samples the CPU time of its processes."""

from __future__ import annotations

import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import psutil

from bench import ROOT

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True, kw_only=True)
class Look:
    """CPU seconds of the farm's processes until one moment, ended processes included."""

    at: float  #: in seconds of `time.time`
    all_: float
    monitor: float


class Watch:
    """Samples the CPU time of `plateau render` and its descendants."""

    def __init__(self, root: psutil.Process) -> None:
        self._root = root
        self._used_s: dict[psutil.Process, float] = {}
        self._monitors: set[psutil.Process] = set()
        self.looks = [Look(at=time.time(), all_=0.0, monitor=0.0)]

    def look(self) -> None:
        """Take a sample; a process that has ended counts as in the sample before."""
        below: list[psutil.Process] = []
        with suppress(psutil.NoSuchProcess):
            below = self._root.children(recursive=True)
        for process in (self._root, *below):
            with suppress(psutil.NoSuchProcess):  # it ended a moment ago
                times = process.cpu_times()
                self._used_s[process] = times.user + times.system
                if "monitor" in process.cmdline():
                    self._monitors.add(process)
        self.looks.append(
            Look(
                at=time.time(),
                all_=sum(self._used_s.values()),
                monitor=sum(self._used_s[one] for one in self._monitors),
            )
        )


def render(
    scene: Path, out: Path, *, parameters: Mapping[str, object], options: Mapping[str, object]
) -> None:
    """Render a scene to its end.

    Parameters
    ----------
    scene
        A folder or a file, as on the command line.
    out
        The folder for the results.
    parameters
        Values of the scene's ``$parameters``.
    options
        Options of the command, such as ``--step``; a flag has the value True.

    Raises
    ------
    subprocess.CalledProcessError
        The command failed; the reason is on standard error.
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
    return psutil.Popen(command, cwd=ROOT, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
