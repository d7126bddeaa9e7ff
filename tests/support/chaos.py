"""Random faults in random order, from a seed: what happens to a farm in a year, in a minute."""

import contextlib
import os
import random
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import psutil

from plateau.farm.blobs import store as blobs
from tests.support.faulty_farm import FaultyFarm

#: How many of each the farm has while all is well.
MEMBERS: Final = {"monitor": 2, "worker": 3}
_PAUSE_S: Final = (0.1, 1.5)  #: between two faults
_LONGEST_S: Final = 4.0  #: of a fault that lasts; a lease of these farms lasts 2 s


class Chaos:
    """Strikes a farm and mends it again.

    Parameters
    ----------
    farm
        The farm; its monitors and workers are started here.
    seed
        What happens depends on it, but not when a process comes to which point of its work.
    tell
        Takes a line for each fault.
    """

    def __init__(self, farm: FaultyFarm, seed: int, tell: Callable[[str], None]) -> None:
        self._farm = farm
        self._random = random.Random(seed)
        self._tell = tell
        self._members: list[tuple[str, subprocess.Popen[bytes]]] = []
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
            (2, self.spoil_a_blob),
            (1, self.lose_a_blob),
        )
        self.struck: dict[str, int] = {}
        self.damaged: set[str] = set()  #: blobs that were spoilt or lost
        self.redis_is_away = False
        for role, count in MEMBERS.items():
            for _ in range(count):
                self._start(role)

    def strike(self) -> None:
        """One fault, after a pause; what is due is mended before."""
        time.sleep(self._random.uniform(*_PAUSE_S))
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

    # Processes.

    def kill(self) -> str | None:
        return self._end(signal.SIGKILL)

    def terminate(self) -> str | None:
        return self._end(signal.SIGTERM)

    def stop(self) -> str | None:
        role, process = self._random.choice(self._members)
        process.send_signal(signal.SIGSTOP)
        self._later(lambda: process.send_signal(signal.SIGCONT))
        return role

    def kill_render_child(self) -> str | None:
        return self._hit_a_child(signal.SIGKILL)

    def stop_render_child(self) -> str | None:
        return self._hit_a_child(signal.SIGSTOP)

    def _start(self, role: str) -> None:
        # Three of these faults may well meet on one slice, and its job would rightly fail.
        process = self._farm.start_changed(role, set={"plateau.farm.ledger.queue:MAX_TRIES": 1000})
        self._members.append((role, process))

    def _end(self, number: signal.Signals) -> str:
        role, process = member = self._random.choice(self._members)
        self._members.remove(member)
        process.send_signal(number)
        process.send_signal(signal.SIGCONT)  # where it was stopped
        if number == signal.SIGKILL:
            process.wait()
            self._farm.processes.remove(process)
        self._start(role)
        return role

    def _hit_a_child(self, number: signal.Signals) -> str | None:
        children = [
            child
            for role, process in self._members
            if role == "worker"
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

    def spoil_a_blob(self) -> str | None:
        path = self._some_blob()
        if path is None:
            return None
        with contextlib.suppress(FileNotFoundError):
            content = bytearray(path.read_bytes())
            content[self._random.randrange(len(content))] ^= 1 << self._random.randrange(8)
            path.write_bytes(content)
        return self._damaged(path)

    def lose_a_blob(self) -> str | None:
        path = self._some_blob()
        if path is None:
            return None
        path.unlink(missing_ok=True)
        return self._damaged(path)

    def _damaged(self, path: Path) -> str:
        self.damaged.add(path.relative_to(self._farm.store.where).as_posix())
        return path.name

    def _some_blob(self) -> Path | None:
        """A partial or a checkpoint: what a job that runs makes again."""
        root = Path(self._farm.store.where)
        found = [
            path
            for kind in (blobs.partials("*"), blobs.checkpoints("*"))
            for path in root.glob(f"{kind}*")
        ]
        return self._random.choice(sorted(found)) if found else None

    def _later(self, repair: Callable[[], None]) -> None:
        self._mend.append((time.monotonic() + self._random.uniform(0, _LONGEST_S), repair))


def _children(process: subprocess.Popen[bytes]) -> list[psutil.Process]:
    with contextlib.suppress(psutil.NoSuchProcess):
        return psutil.Process(process.pid).children()
    return []
