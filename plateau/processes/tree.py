"""The process tree of `plateau render` and `plateau up`: Redis, API, monitor and workers."""

import os
import select
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Final, TextIO

from plateau.errors import PlateauError
from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.process.lifecycle import how_ended, shut_memory
from plateau.farm.process.scratch import remove_left
from plateau.farm.process.settings import Settings
from plateau.farm.process.waits import Backoff
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.processes.data_folder import DataFolder
from plateau.processes.interrupts import Interrupts
from plateau.processes.member import Member
from plateau.processes.read_settings import REDIS_VARIABLES
from plateau.worker.supervisor import gpus, needed_libraries
from plateau.worker.supervisor.machine import memory_for_children

_API_START_S: Final = 60.0
#: Time to stop before the kill; a stopping worker tries for 5 s to commit its slice.
_STOP_S: Final = {"worker": 15.0, "monitor": 10.0, "api": 8.0}
_HURRIED_S: Final = 2.0
_TICK_S: Final = 0.05
#: Settings of a farm that is about to go: nothing continues or restores its jobs.
_FOR_A_WHILE: Final = {"PLATEAU_KEEP_SUMS_DAYS": "0", "PLATEAU_KEEP_DELETED_DAYS": "0"}
#: A Redis that lived this long has started well.
_REDIS_WELL_S: Final = 30.0


@dataclass(frozen=True)
class Door:
    """Where and for whom the API listens: options of `plateau api` and `plateau up`."""

    host: str = "127.0.0.1"
    port: int = 0  #: 0 for a free one
    open_to_all: bool = False  #: require no API key, on a loopback address, even if there are some
    certificate: Path | None = None  #: for HTTPS, with its private key
    private_key: Path | None = None

    def options(self) -> tuple[str, ...]:
        """All but the port, as options of the command line."""
        options = ["--host", self.host]
        if self.open_to_all:
            options.append("--open")
        if self.certificate is not None:
            options += ["--tls-certificate", str(self.certificate)]
        if self.private_key is not None:
            options += ["--tls-key", str(self.private_key)]
        return tuple(options)


class TreeFailed(PlateauError):
    """A process of the tree died too often, or did not start."""


@dataclass(eq=False)
class Tree:
    """Every process that Plateau needs on one machine; none outlives the context.

    A process that dies is restarted after a growing pause. The thread that enters the context must
    be the main one, because the kernel ends the processes with it.

    Raises
    ------
    LibraryMissing
        On entering: the workers lack a library for rendering.
    Incompatible
        On entering: the data folder has another layout.
    TreeFailed
        By `check`; by `await_api` if the API does not start.
    KeyboardInterrupt
        By `await_api`, after an interrupt.
    """

    settings: Settings  #: if `redis_url` or `blobs` is unset, the data folder is used
    data: DataFolder  #: locked
    interrupts: Interrupts  #: the first one ends the start; the second one forces the stop
    _: KW_ONLY
    workers: int  #: they share the machine's cores
    door: Door
    tell: Callable[[str], None]  #: called with a line about each restart
    #: Deaths of a process in a row, each soon after its start, that fail the tree; None: no limit.
    most_deaths: int | None
    is_temporary: bool = False  #: the data folder is removed with the tree
    secret: str = ""  #: with which other machines reach the embedded Redis, at `redis_port`

    def __post_init__(self) -> None:
        self.url = ""
        self.blobs = self.settings.blobs or str(self.data.blobs.absolute())
        self.redis_url = self.settings.redis_url or ""
        self.redis_port = 0  # of the embedded Redis, where there is a secret
        self._redis: EmbeddedRedis | None = None
        self._redis_backoff = Backoff(0.5, 30.0)
        self._redis_start_at = 0.0  # restart it not before this
        self._members: list[Member] = []
        self._api_pipe: TextIO | None = None  # where the API writes its URL once it answers

    def __enter__(self) -> "Tree":
        with suppress(OSError):
            shut_memory()  # this process has the same credentials as the others
        try:
            self._start()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()

    def await_api(self) -> str:
        """The API's URL, once it answers; call it once, before `check`."""
        api, pipe = self._members[0], self._api_pipe
        assert pipe is not None, "the tree is not entered"
        with pipe:
            self.url = self._wait_for_url(api, pipe)
        api.arguments += ("--port", self.url.rpartition(":")[2])
        self.data.note_url(self.url)
        return self.url

    def check(self) -> None:
        """Restart dead processes; call it a few times a second.

        Raises `KeyboardInterrupt` after an interrupt while Redis starts again.
        """
        if self._redis is not None:
            self._start_again(self._redis)
        for member in self._members:
            member.rotate_log()
            cause = member.has_died()
            if cause is not None:
                if self.most_deaths is not None and member.deaths >= self.most_deaths:
                    raise TreeFailed(f"{cause}; its log:\n{member.last_words()}")
                self.tell(f"{cause}; starting it again (its log: {member.log})")
            try:
                member.start_if_due()
            except OSError as error:  # the machine has no process or no memory left just now
                self.tell(f"{member.name} cannot be started: {error.strerror}; trying again")

    def _start_again(self, server: EmbeddedRedis) -> None:
        """Restart Redis if it has died; the others wait for it and lose nothing."""
        server.rotate_log()
        if server.process.poll() is not None and time.monotonic() >= self._redis_start_at:
            self.tell(f"Redis {how_ended(server.process.returncode)}; starting it again")
            try:
                server.start(self.interrupts.asked.is_set)
            except (StoreUnavailable, OSError) as error:
                self.tell(str(error))
            self._redis_start_at = time.monotonic() + self._redis_backoff.delay_s()
        elif time.monotonic() > self._redis_start_at + _REDIS_WELL_S:
            self._redis_backoff.reset()

    def stop(self) -> None:
        """Stop workers, monitor, API and Redis in this order, by force after their time."""
        for role in ("worker", "monitor", "api"):
            ones = [member for member in self._members if member.name.startswith(role)]
            for member in ones:
                member.ask_to_stop()
            started = time.monotonic()
            while any(member.is_running() for member in ones):
                hurried = self.interrupts.insisted.is_set()
                if time.monotonic() - started > (_HURRIED_S if hurried else _STOP_S[role]):
                    break
                time.sleep(_TICK_S)
            for member in ones:
                member.kill()
        remove_left()  # of a worker that was killed while it tried what works here
        self._members = []
        if self._api_pipe is not None:
            self._api_pipe.close()
        if self._redis is not None:
            self._redis.stop()
            self._redis = None

    def _start(self) -> None:
        if self.workers:
            needed_libraries.check()
        if self.settings.redis_url is None:
            self._redis = EmbeddedRedis(self.data.redis, wait=False, secret=self.secret)
            self.redis_url, self.redis_port = self._redis.url, self._redis.port
        if self.is_temporary:  # Redis is ready before the others first connect
            self._start_members()
            self._await_redis()
        else:  # Redis's folder must be on the disk before anything is written
            self._await_redis()
            self._start_members()

    def _await_redis(self) -> None:
        if self._redis is None:
            return
        self._redis.await_ready(self.interrupts.asked.is_set)
        from plateau.farm.ledger.schema import check_schema
        from plateau.farm.redis.link import connect

        with connect(self.redis_url) as client:
            check_schema(client)

    def _start_members(self) -> None:
        api = self._member("api", ("api", *self.door.options()))
        others = [self._member("monitor", ("monitor",))]
        others += [
            self._member(
                f"worker-{number + 1}", ("worker",), self._of_a_worker() | gpus.of_worker(number)
            )
            for number in range(self.workers)
        ]
        self._members = [api, *others]
        reads, writes = os.pipe()
        self._api_pipe = os.fdopen(reads, encoding="utf-8")
        try:
            api.start(
                passed=(writes,), more=("--port", str(self.door.port), "--ready-fd", str(writes))
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
                **dict.fromkeys(REDIS_VARIABLES, ""),  # the URL contains them
                "PLATEAU_REDIS_URL": self.redis_url,
                "PLATEAU_BLOBS": self.blobs,
                **(_FOR_A_WHILE if self.is_temporary else {}),
                **(environment or {}),
            },
            logs=self.data.logs,
            inherited=(self.data.lock_fd,),
        )

    def _of_a_worker(self) -> dict[str, str]:
        share = max(1, len(os.sched_getaffinity(0)) // self.workers)
        memory_gb = self.settings.child_memory_gb or memory_for_children() / self.workers / 1e9
        return {
            "PLATEAU_THREADS": str(self.settings.threads or share),
            "PLATEAU_POOL": self.settings.pool,
            "PLATEAU_TAGS": ",".join(self.settings.tags),
            "PLATEAU_CHILD_MEMORY_GB": f"{memory_gb:g}",
        }

    def _wait_for_url(self, api: Member, pipe: TextIO) -> str:
        """The URL that the API writes into its end of the pipe once it answers."""
        deadline, url = time.monotonic() + _API_START_S, ""
        while time.monotonic() < deadline and not self.interrupts.asked.is_set():
            if select.select([pipe], [], [], _TICK_S)[0]:
                url = pipe.readline().strip()  # empty if the API died
                break
        if self.interrupts.asked.is_set():
            raise KeyboardInterrupt
        if not url:
            raise TreeFailed(f"the API did not start; its log:\n{api.last_words()}")
        return url
