"""Random faults in random order, from a seed: what happens to a farm in a year, in a minute."""

import contextlib
import os
import random
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final

import psutil

from plateau.errors import ExitCode
from plateau.farm.blobs import names as blobs
from tests.support.farms.faulty_farm import FaultyFarm

#: The commands of those that are struck, as many as the farm has while all is well.
MEMBERS: Final = (("monitor",),) * 2 + (("worker",),) * 3
PAUSE_S: Final = (0.1, 1.5)  #: between two faults
_MOST_SPOILT: Final = 2  #: partials of a slice, which may be rendered four times
_LONGEST_S: Final = 4.0  #: of a fault that lasts; a lease of these farms lasts 2 s


class Chaos:
    """Strikes a farm and mends it again.

    Parameters
    ----------
    farm
        The farm; whom it strikes is started here, and there may be others.
    seed
        What happens depends on it, but not when a process comes to which point of its work.
    tell
        Takes a line for each fault.
    members
        The commands of those that it strikes.
    pause_s
        The shortest and the longest time between two faults.
    """

    def __init__(
        self,
        farm: FaultyFarm,
        seed: int,
        tell: Callable[[str], None],
        members: Iterable[tuple[str, ...]] = MEMBERS,
        pause_s: tuple[float, float] = PAUSE_S,
    ) -> None:
        self._farm = farm
        self._random = random.Random(seed)
        self._tell = tell
        self._pause_s = pause_s
        self._members: list[tuple[tuple[str, ...], subprocess.Popen[bytes]]] = []
        self._leaving: list[subprocess.Popen[bytes]] = []
        self._mend: list[tuple[float, Callable[[], None]]] = []
        self._faults = (
            (4, self.kill),
            (2, self.stop),
            (2, self.terminate),
            (3, self.kill_render_child),
            (1, self.stop_render_child),
            (2, self.kill_redis),
            (1, self.stop_redis),
            (1, self.take_the_store_away),
            (2, self.damage_a_blob),
            (1, self.lose_a_blob),
        )
        self.struck: dict[str, int] = {}
        self.damaged: set[str] = set()  #: blobs that were spoilt or lost
        self._spoilt: Counter[Path] = Counter()  #: how often, by slice
        self.redis_is_away = False
        for command in members:
            self._start(command)

    def strike(self) -> None:
        """One fault, after a pause; what is due is mended before."""
        time.sleep(self._random.uniform(*self._pause_s))
        self.mend()
        weights = [weight for weight, _ in self._faults]
        (_, fault) = self._random.choices(self._faults, weights)[0]
        name = fault.__name__.replace("_", " ")
        what = fault()
        if what is not None:
            self.struck[name] = self.struck.get(name, 0) + 1
            self._tell(f"{name}: {what}")

    def mend(self, *, everything: bool = False) -> None:
        """End the faults whose time has come, or all."""
        due = [one for one in self._mend if everything or one[0] <= time.monotonic()]
        self._mend = [one for one in self._mend if one not in due]
        for _, repair in due:
            repair()
        for process in [one for one in self._leaving if one.poll() is not None]:
            self._leaving.remove(process)
            self._forget(process)
        for member in [one for one in self._members if one[1].poll() is not None]:
            self._members.remove(member)  # one that started while the store was away
            self._forget(member[1])
            self._start(member[0])

    def _forget(self, process: subprocess.Popen[bytes]) -> None:
        # One that was told to stop before it listened is ended by the signal itself.
        assert process.returncode in {0, ExitCode.FAILED, -signal.SIGTERM}, process.args
        self._farm.processes.remove(process)

    # Processes.

    def kill(self) -> str | None:
        return self._end(signal.SIGKILL)

    def terminate(self) -> str | None:
        return self._end(signal.SIGTERM)

    def stop(self) -> str | None:
        command, process = self._random.choice(self._members)
        process.send_signal(signal.SIGSTOP)
        self._later(lambda: process.send_signal(signal.SIGCONT))
        return command[0]

    def kill_render_child(self) -> str | None:
        return self._hit_a_child(signal.SIGKILL)

    def stop_render_child(self) -> str | None:
        return self._hit_a_child(signal.SIGSTOP)

    def _start(self, command: tuple[str, ...]) -> None:
        self._members.append((command, self._farm.start_patient(*command)))

    def _end(self, number: signal.Signals) -> str:
        command, process = member = self._random.choice(self._members)
        self._members.remove(member)
        process.send_signal(number)
        process.send_signal(signal.SIGCONT)  # where it was stopped
        if number == signal.SIGKILL:
            process.wait()
            self._farm.processes.remove(process)
        else:
            self._leaving.append(process)
        self._start(command)
        return command[0]

    def _hit_a_child(self, number: signal.Signals) -> str | None:
        children = [
            child
            for command, process in self._members
            if command[0] == "worker"
            for child in _children(process)
        ]
        if not children:
            return None
        with contextlib.suppress(psutil.NoSuchProcess):
            self._random.choice(children).send_signal(number)
        return number.name

    # Redis.

    def kill_redis(self) -> str | None:
        if self.redis_is_away:
            return None
        server = self._farm.redis
        server.process.kill()
        server.process.wait()
        self._redis_away_until(server.start)
        return "and start it again"

    def stop_redis(self) -> str | None:
        if self.redis_is_away:
            return None
        server = self._farm.redis
        process = server.process
        os.kill(process.pid, signal.SIGSTOP)
        self._redis_away_until(lambda: process.send_signal(signal.SIGCONT))
        return "and let it go on"

    def _redis_away_until(self, repair: Callable[[], None]) -> None:
        def mend() -> None:
            repair()
            self.redis_is_away = False

        self.redis_is_away = True
        self._later(mend)

    # The blob store.

    def take_the_store_away(self) -> str | None:
        here = Path(self._farm.store.where)
        away = here.with_name("away")
        if away.exists():
            return None
        here.rename(away)

        def bring_back() -> None:
            if here.exists():  # somebody has made a folder there meanwhile
                for left in sorted(here.rglob("*"), reverse=True):
                    left.rmdir() if left.is_dir() else left.unlink()
                here.rmdir()
            away.rename(here)

        self._later(bring_back)
        return "and bring it back"

    def damage_a_blob(self) -> str | None:
        path = self._some_blob()
        if path is None:
            return None
        with contextlib.suppress(FileNotFoundError), path.open("r+b") as file:
            where = self._random.randrange(path.stat().st_size)
            file.seek(where)
            byte = file.read(1)[0] ^ 1 << self._random.randrange(8)
            file.seek(where)
            file.write(bytes([byte]))
        return self._damaged(path)

    def lose_a_blob(self) -> str | None:
        path = self._some_blob()
        if path is None:
            return None
        path.unlink(missing_ok=True)
        return self._damaged(path)

    def _damaged(self, path: Path) -> str:
        self.damaged.add(path.relative_to(self._farm.store.where).as_posix())
        self._spoilt[_slice_of(path)] += 1
        return path.name

    def _some_blob(self) -> Path | None:
        """A partial or a checkpoint: what a job that runs makes again.

        A slice whose partial never comes back whole fails its job, so none is spoilt that often.
        """
        root = Path(self._farm.store.where)
        found = [
            path
            for kind in (blobs.partials("*"), blobs.checkpoints("*"))
            for path in root.glob(f"{kind}*")
            if self._spoilt[_slice_of(path)] < _MOST_SPOILT
        ]
        return self._random.choice(sorted(found)) if found else None

    def _later(self, repair: Callable[[], None]) -> None:
        self._mend.append((time.monotonic() + self._random.uniform(0, _LONGEST_S), repair))


def _slice_of(partial: Path) -> Path:
    """What all partials of a slice have in common; of a checkpoint its own path."""
    return partial.with_name(partial.name.partition("-")[0])


def _children(process: subprocess.Popen[bytes]) -> list[psutil.Process]:
    with contextlib.suppress(psutil.NoSuchProcess):
        return psutil.Process(process.pid).children()
    return []
