"""Process trees: their CPU time beside that of the machine, and trees that run in turns.

The speed of a virtual machine drifts. Two runs of a minute, one after the other, then differ by
more than is to be measured. So both are alive at once and run in turns of some seconds, stopped
(SIGSTOP) in between; the clock of each counts its own turns only.
"""

import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import psutil

from bench import ROOT

#: Short compared with the drift, and long compared with what a stop costs. That is more than a
#: change of turns: a render child that is stopped in a chunk takes it for slow, and makes the next
#: ones smaller.
TURN_S: Final = 4.0
_POLL_EVERY_S: Final = 0.005
_LOOK_EVERY_S: Final = 0.5


@dataclass
class Ran:
    """The turns of a process tree and its CPU time, once it has ended."""

    turns: list[tuple[float, float]] = field(default_factory=list)  #: start and end, `time.time`
    cpu_s: float = 0.0

    def own_s(self, until: float = float("inf")) -> float:
        """Return the seconds of its turns before a moment of `time.time`."""
        return sum(max(0.0, min(end, until) - start) for start, end in self.turns)


def take_turns(
    processes: Mapping[str, psutil.Popen],
    turn_s: float = TURN_S,
    *,
    look: Callable[[], None] = lambda: None,
) -> dict[str, Ran]:
    """Let new processes, each with its descendants, run in turns until all have ended.

    `look` is called twice a second and between turns, whoever's turn it is: so all pay for it
    alike. If one fails, all others are killed, and `ChildProcessError` is raised.
    """
    ran = {name: Ran() for name in processes}
    trees = {name: _Tree(process) for name, process in processes.items()}
    try:
        for tree in trees.values():
            tree.stop()
        while trees:
            for name, tree in list(trees.items()):
                buried_cpu_s = children_cpu_s()
                started = time.time()
                tree.go_on()
                status = tree.status(turn_s, look)
                ended = tree.stop() if status is None else time.time()
                ran[name].turns.append((started, ended))
                if status is None:
                    look()
                    continue
                ran[name].cpu_s = children_cpu_s() - buried_cpu_s
                if status:
                    raise ChildProcessError(f"{name}: exit code {status}")
                del trees[name]
    finally:
        for tree in trees.values():
            tree.kill()
    return ran


class _Tree:
    """A process and its descendants.

    These are looked up after a turn, since that takes milliseconds: so a turn begins and ends for
    all of them at once.
    """

    def __init__(self, root: psutil.Popen) -> None:
        self._root = root
        self._members: list[psutil.Process] = [root]

    def go_on(self) -> None:
        self._signal(self._members, signal.SIGCONT)

    def stop(self) -> float:
        """Stop all; return when those known at the start of the turn had stopped."""
        self._signal(self._members, signal.SIGSTOP)
        stopped_at = time.time()
        while born := [one for one in self._below() if one not in self._members]:
            self._signal(born, signal.SIGSTOP)
            self._members += born
        self._members = [self._root, *(one for one in self._members[1:] if one.is_running())]
        return stopped_at

    def status(self, within_s: float, look: Callable[[], None]) -> int | None:
        """Return the root's exit code once it ends; None if it still runs after `within_s`."""
        began = looked = time.monotonic()
        status: int | None = None
        while status is None and time.monotonic() < began + within_s:
            time.sleep(_POLL_EVERY_S)
            if time.monotonic() >= looked + _LOOK_EVERY_S:
                look()
                looked = time.monotonic()
            status = self._root.poll()
        return status

    def kill(self) -> None:
        """Kill all processes."""
        self._signal([*self._members, *self._below()], signal.SIGKILL)
        self._root.wait()

    def _below(self) -> list[psutil.Process]:
        with suppress(psutil.NoSuchProcess):
            return self._root.children(recursive=True)
        return []

    @staticmethod
    def _signal(members: list[psutil.Process], number: signal.Signals) -> None:
        for one in members:
            with suppress(psutil.NoSuchProcess):  # it ended a moment ago
                one.send_signal(number)


@dataclass
class Taken:
    """The cost of some work, once it is over."""

    wall_s: float = 0.0
    cpu_s: float = 0.0  #: of this process's descendants that ended meanwhile
    others: float = 0.0  #: share of the cores that all other work took, the host's included


@contextmanager
def timed() -> Iterator[Taken]:
    """Measure the context; the numbers are set when it is left."""
    taken = Taken()
    started, ended = time.monotonic(), children_cpu_s()
    family, machine = _family_cpu_s(), _machine_cpu_s()
    yield taken
    taken.wall_s = time.monotonic() - started
    taken.cpu_s = children_cpu_s() - ended
    others_s = _machine_cpu_s() - machine - (_family_cpu_s() - family)
    taken.others = max(0.0, others_s) / (taken.wall_s * (psutil.cpu_count() or 1))


def cpu_s(evaluate: Callable[[], object]) -> float:
    """Return the CPU time of a call in this process."""
    started = time.process_time()
    evaluate()
    return time.process_time() - started


def children_cpu_s() -> float:
    """Return the CPU seconds of this process's descendants that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _machine_cpu_s() -> float:
    """Return the CPU seconds that the machine has spent, or that its host withheld."""
    times = psutil.cpu_times()
    # Guests' time is part of the user's.
    idle = {"idle", "iowait", "guest", "guest_nice"}
    return float(sum(value for name, value in times._asdict().items() if name not in idle))


def _family_cpu_s() -> float:
    """Return the CPU seconds of this process and all its descendants, alive or ended."""
    ours = psutil.Process()
    used = ours.cpu_times()
    spent = used.user + used.system + used.children_user + used.children_system
    for process in ours.children(recursive=True):
        with suppress(psutil.NoSuchProcess):  # it ended a moment ago
            times = process.cpu_times()
            spent += times.user + times.system
    return float(spent)


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
    """Render a scene to its end by `plateau render`; raise `CalledProcessError` if that fails.

    A flag among the `options`, such as ``--keep-slices``, has the value True.
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
