"""A farm whose processes are stopped and started one by one, while people use it."""

import signal
import subprocess
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from plateau.client import Client, PointEvent
from plateau.farm.model.job import Event
from plateau.farm.model.spec import JobSpec
from plateau.farm.redis import keys
from tests.support import FRAMES
from tests.support.farms.faulty_farm import SPEC, FaultyFarm
from tests.support.farms.real_farm import BOX
from tests.support.until import until

#: A client repeats for so long what an API does not answer that is being replaced.
PATIENCE_S = 120.0


@dataclass(eq=False)
class Member:
    """A process of the farm; the one that runs at a time."""

    role: str
    arguments: tuple[str, ...]
    process: subprocess.Popen[bytes]


class UpgradedFarm(FaultyFarm):
    """Two APIs with ports of their own, and monitors and workers, to be restarted in turn.

    Leases last as long as they usually do: what one process leaves, another must take at once, or
    the test shows that it waited.
    """

    def __init__(self, folder: Path, cache: Path) -> None:
        super().__init__(folder, cache, PLATEAU_LEASE_S="15")
        self.members: list[Member] = []
        first = self.processes[0]
        self.members.append(Member("api", ("--port", _port(self.url)), first))
        self.urls = [self.url]

    def begin(self, *, monitors: int, workers: int) -> None:
        """Start a second API, and so many of the others."""
        process, url = self.start_api()
        self.members.append(Member("api", ("--port", _port(url)), process))
        self.urls.append(url)
        for role, count in (("monitor", monitors), ("worker", workers)):
            self.members += [Member(role, (), self.start(role)) for _ in range(count)]
        for member in self.members:
            until(lambda member=member: self.works(member))  # type: ignore[misc]

    def works(self, member: Member) -> bool:
        """Whether the member has joined the farm."""
        if member.role == "api":  # it has said that it is ready
            return True
        members = {"monitor": keys.MONITORS, "worker": keys.WORKERS}
        names = self.redis_client.zrange(members[member.role], 0, -1)
        return any(f"-{member.process.pid}-" in name for name in names)

    def stop(self, member: Member) -> float:
        """Stop it as an administrator does; returns how many seconds it took."""
        asked = time.monotonic()
        member.process.send_signal(signal.SIGTERM)
        assert member.process.wait(60) == 0, f"the {member.role} did not stop cleanly"
        self.processes.remove(member.process)
        return time.monotonic() - asked

    def restart(self, member: Member) -> float:
        """Stop it and start it again; returns how many seconds it took to stop."""
        took_s = self.stop(member)
        if member.role == "api":
            member.process, _ = self.start_api(member.arguments[1])
        else:
            member.process = self.start(member.role)
        until(lambda: self.works(member))
        return took_s


@dataclass
class Watched:
    """A job that somebody has submitted, and what was heard of it."""

    job_id: str
    events: list[Event] = field(default_factory=list)

    @property
    def points(self) -> list[int]:
        """The spp of each point of the curve that was heard of, in their order."""
        return [event.point.spp for event in self.events if isinstance(event, PointEvent)]


class People:
    """Submit jobs one after the other, each at an API of their own, and watch each to its end."""

    def __init__(
        self, urls: list[str], key: str | None = None, spec: dict[str, Any] = SPEC
    ) -> None:
        self._key, self._spec = key, JobSpec.model_validate(FRAMES | spec)
        self.watched: list[Watched] = []
        self.troubles: list[BaseException] = []
        self._over = threading.Event()
        self._threads = [
            threading.Thread(target=self._noting(lambda url=url: self._use(url)))  # type: ignore[misc]
            for url in urls
        ]

    def __enter__(self) -> "People":
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        for thread in self._threads:
            thread.join()

    def _use(self, url: str) -> None:
        with Client(url, key=self._key, patience_s=PATIENCE_S) as client:
            while not self._over.is_set():
                watched = Watched(client.submit(BOX, self._spec).id)
                self.watched.append(watched)
                for event in client.events(watched.job_id):
                    watched.events.append(event)

    def _noting(self, work: Callable[[], None]) -> Callable[[], None]:
        def run() -> None:
            try:
                work()
            except BaseException as error:  # noqa: BLE001  (the test's thread looks at them)
                self.troubles.append(error)

        return run


def _port(url: str) -> str:
    return url.rpartition(":")[2]
