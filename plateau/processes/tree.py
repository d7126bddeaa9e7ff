"""The process tree of `plateau render` and `plateau up`: Redis, API, monitor and workers."""

import os
import select
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Final, TextIO

from plateau.errors import PlateauError
from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.process.backoff import Backoff
from plateau.farm.process.lifecycle import shut_memory
from plateau.farm.process.settings import Settings
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.processes.data_folder import DataFolder
from plateau.processes.interrupts import Interrupts
from plateau.processes.member import Member, describe_exit
from plateau.processes.read_settings import REDIS_VARIABLES
from plateau.worker.supervisor import needed_libraries

_API_START_S: Final = 60.0
#: A stopping worker tries for 5 s to commit what it has.
_STOP_S: Final = {"worker": 15.0, "monitor": 10.0, "api": 8.0}
_HURRIED_S: Final = 2.0
_TICK_S: Final = 0.05
#: A Redis that lived for so long had started well.
_REDIS_WELL_S: Final = 30.0


@dataclass(frozen=True)
class Door:
    """The options of `plateau api` that `plateau up` has too."""

    host: str = "127.0.0.1"
    port: int = 0  #: 0 takes a free one
    open_to_all: bool = False  #: want no keys, on a loopback address, though there are some
    certificate: Path | None = None  #: for https, with its private key
    private_key: Path | None = None

    def options(self) -> tuple[str, ...]:
        """All but the port, as they are written on a command line."""
        options = ["--host", self.host]
        if self.open_to_all:
            options.append("--open")
        if self.certificate is not None:
            options += ["--tls-certificate", str(self.certificate)]
        if self.private_key is not None:
            options += ["--tls-key", str(self.private_key)]
        return tuple(options)


class TreeFailed(PlateauError):
    """A process of the tree died and will not be started again."""


class Tree:
    """Every process that Plateau needs on one machine; none outlives the context.

    A process that dies is started again, after a pause that grows. All of it runs in the thread
    that enters the context, which must be the main one: the kernel ends the processes with it.

    Parameters
    ----------
    settings
        Where `redis_url` or `blobs` is unset, the data folder is used.
    data
        The data folder, locked.
    interrupts
        Once it was asked, starting is given up; once it was insisted, stopping is by force.
    workers
        Number of workers; they share the machine's cores.
    door
        Where the API listens, and for whom.
    tell
        Takes a line about what was started again.
    is_temporary
        Whether the data folder goes with the tree, so that nothing in it need outlive a power loss.
    most_deaths
        A process that dies so often in a row, each time within 30 s of its start, fails the
        tree; None to try for ever.

    Raises
    ------
    LibraryMissing
        On entering: there are to be workers, and a library that rendering needs is not here.
    SchemaMismatch
        On entering: the data folder holds another layout.
    TreeFailed
        By `check`; by `await_api`, where the API does not start.
    KeyboardInterrupt
        By `await_api`: the interrupts were asked.
    """

    def __init__(
        self,
        settings: Settings,
        data: DataFolder,
        interrupts: Interrupts,
        *,
        workers: int,
        door: Door,
        tell: Callable[[str], None],
        most_deaths: int | None,
        is_temporary: bool = False,
    ) -> None:
        self.url = ""
        self.blobs = settings.blobs or str(data.blobs.absolute())
        self.redis_url = settings.redis_url or ""
        self._settings = settings
        self._data = data
        self._interrupts = interrupts
        self._workers = workers
        self._door = door
        self._tell = tell
        self._most_deaths = most_deaths
        self._is_temporary = is_temporary
        self._redis: EmbeddedRedis | None = None
        self._redis_backoff = Backoff(0.5, 30.0)
        self._redis_start_at = 0.0  # not before that
        self._members: list[Member] = []
        self._api_says: TextIO | None = None  # where the API writes its URL once it answers

    def __enter__(self) -> "Tree":
        with suppress(OSError):
            shut_memory()  # whoever starts them has the same credentials as they have
        try:
            self._start()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.stop()

    def await_api(self) -> str:
        """The API's URL, once it answers; to be called once, before `check`."""
        api, says = self._members[0], self._api_says
        if says is None:
            raise ValueError("the tree is not entered")
        with says:
            self.url = self._wait_for_url(api, says)
        api.arguments += ("--port", self.url.rpartition(":")[2])
        self._data.note_url(self.url)
        return self.url

    def check(self) -> None:
        """Start again what has died; to be called a few times a second."""
        if self._redis is not None:
            self._start_again(self._redis)
        for member in self._members:
            member.rotate_log()
            cause = member.has_died()
            if cause is not None:
                self._bury(member, cause)
            member.start_if_due()

    def _start_again(self, server: EmbeddedRedis) -> None:
        """Start Redis again where it has died; the others wait for it and lose nothing."""
        server.rotate_log()
        if server.process.poll() is not None and time.monotonic() >= self._redis_start_at:
            self._tell(f"Redis {describe_exit(server.process.returncode)}; starting it again")
            try:
                server.start()
            except StoreUnavailable as error:
                self._tell(str(error))
            self._redis_start_at = time.monotonic() + self._redis_backoff.delay_s()
        elif time.monotonic() > self._redis_start_at + _REDIS_WELL_S:
            self._redis_backoff.reset()

    def wind_down(self) -> None:
        """Ask all but Redis to stop, and do not wait: there is nothing left for them to do.

        `check` would start them again.
        """
        for member in self._members:
            member.ask_to_stop()

    def stop(self) -> None:
        """Stop workers, monitor, API and Redis, in this order; by force what does not stop."""
        for role in ("worker", "monitor", "api"):
            ones = [member for member in self._members if member.name.startswith(role)]
            for member in ones:
                member.ask_to_stop()
            started = time.monotonic()
            while any(member.is_running() for member in ones):
                hurried = self._interrupts.insisted.is_set()
                if time.monotonic() - started > (_HURRIED_S if hurried else _STOP_S[role]):
                    break
                time.sleep(_TICK_S)
            for member in ones:
                member.kill()
        self._members = []
        if self._api_says is not None:
            self._api_says.close()
        if self._redis is not None:
            self._redis.stop()
            self._redis = None

    def _start(self) -> None:
        if self._workers:
            needed_libraries.check()
        if self._settings.redis_url is None:
            self._redis = EmbeddedRedis(self._data.redis, wait=False)
            self.redis_url = self._redis.url
        if self._is_temporary:  # the others take longer than Redis until they first ask for it
            self._start_members()
            self._await_redis()
        else:  # nothing is written before Redis's folder is on the disk
            self._await_redis()
            self._start_members()

    def _await_redis(self) -> None:
        if self._redis is None:
            return
        self._redis.await_ready()
        from plateau.farm.ledger.schema import await_schema
        from plateau.farm.redis.link import connect

        with connect(self.redis_url) as client:  # of what was killed a moment ago, all must be over
            await_schema(client, self._interrupts.asked)

    def _start_members(self) -> None:
        api = self._member("api", ("api", *self._door.options()))
        others = [self._member("monitor", ("monitor",))]
        others += [
            self._member(f"worker-{number}", ("worker",), self._of_a_worker())
            for number in range(1, self._workers + 1)
        ]
        self._members = [api, *others]
        reads, writes = os.pipe()
        self._api_says = os.fdopen(reads)
        try:
            api.start(
                passed=(writes,), more=("--port", str(self._door.port), "--ready-fd", str(writes))
            )
        finally:
            os.close(writes)
        for member in others:
            member.start()

    def _member(
        self, name: str, arguments: tuple[str, ...], environment: dict[str, str] | None = None
    ) -> Member:
        return Member(
            name,
            arguments,
            environment={
                **dict.fromkeys(REDIS_VARIABLES, ""),  # what they say is in the URL
                "PLATEAU_REDIS_URL": self.redis_url,
                "PLATEAU_BLOBS": self.blobs,
                **(environment or {}),
            },
            logs=self._data.logs,
            inherited=(self._data.lock_fd,),
        )

    def _of_a_worker(self) -> dict[str, str]:
        share = max(1, len(os.sched_getaffinity(0)) // self._workers)
        return {
            "PLATEAU_THREADS": str(self._settings.threads or share),
            "PLATEAU_POOL": self._settings.pool,
            "PLATEAU_TAGS": ",".join(self._settings.tags),
            "PLATEAU_WORKERS_HERE": str(max(self._workers, self._settings.workers_here)),
        }

    def _wait_for_url(self, api: Member, pipe: TextIO) -> str:
        """The URL that the API writes into its end of the pipe once it answers."""
        deadline = time.monotonic() + _API_START_S
        while not select.select([pipe], [], [], _TICK_S)[0]:
            if self._interrupts.asked.is_set():
                raise KeyboardInterrupt
            if time.monotonic() > deadline:
                raise TreeFailed(f"the API did not start; its log:\n{api.last_words()}")
        url = pipe.readline().strip()
        if not url:  # it died, and its end was closed
            raise TreeFailed(f"the API did not start; its log:\n{api.last_words()}")
        return url

    def _bury(self, member: Member, cause: str) -> None:
        if self._most_deaths is not None and member.deaths >= self._most_deaths:
            raise TreeFailed(f"{cause}; its log:\n{member.last_words()}")
        self._tell(f"{cause}; starting it again (its log: {member.log})")
