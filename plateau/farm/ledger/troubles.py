"""The troubles of a farm that its operator is notified of: each once, until it is over."""

import socket
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from plateau.farm.blobs.names import MARK
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.totals import take_census
from plateau.farm.ledger.workers import Workers
from plateau.farm.model.errors import BlobsUnavailable
from plateau.farm.model.fit import Crew, waits_for
from plateau.farm.model.worker import Worker
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.notices import NoteTold, NoteTroubles
from plateau.farm.redis.scripts import Scripts

#: How many jobs without a worker are read.
_MOST_READ: Final = 50
#: A worker that failed so often in a row is a trouble.
_MANY: Final = 3
#: What is written to see whether the blob store is full.
_PROBE: Final = bytes(1 << 20)
_FARM: Final = "*"  #: no host's name


@dataclass(frozen=True)
class Trouble:
    """Something that the operator should see to."""

    name: str  #: which stays the same while it lasts
    words: str
    job: str = ""  #: the id of one that has it


def of_farm(client: RedisClient) -> list[Trouble]:
    """What all monitors see: jobs without a worker, and workers that fail."""
    workers = Workers(client).living()
    return [*_unserved(client, Crew(workers)), *_failing(workers)]


def of_store(store: Blobs) -> list[Trouble]:
    """What this machine sees of the blob store: that nothing can be written there."""
    probe = f"{MARK}-probe-{socket.gethostname()}"
    try:
        store.put(probe, _PROBE)
        store.delete(probe)
    except BlobsUnavailable as error:
        words = f"{socket.gethostname()} cannot write into the blob store: {error}"
        return [Trouble("storage", words)]
    return []


def _unserved(client: RedisClient, crew: Crew) -> list[Trouble]:
    jobs = Jobs(client)
    waiting: dict[str, Trouble] = {}
    counted: Counter[str] = Counter()
    for job_id in take_census(client).unserved[:_MOST_READ]:
        job = jobs.get(job_id)
        words = waits_for(job, crew)
        if words is not None:
            counted[words] += 1
            waiting.setdefault(words, Trouble(words, f"job {job.name} ({job_id}) {words}", job_id))
    return [
        Trouble(
            one.name,
            one.words + (f"; it is one of {counted[one.name]}" if counted[one.name] > 1 else ""),
            one.job,
        )
        for one in waiting.values()
    ]


def _failing(workers: list[Worker]) -> list[Trouble]:
    """Those that take no work, or fail again and again; one a machine."""
    found = {}
    for worker in workers:
        words = f"takes no work: {worker.trouble}" if worker.trouble else None
        if words is None and worker.failures >= _MANY:
            words = f"failed {worker.failures} times in a row, at last so: {worker.last_error}"
        if words is not None and not worker.drained:
            words = f"worker {worker.id} {words}"
            found[worker.host] = Trouble(f"worker {worker.host}", words)
    return list(found.values())


class ToldTroubles:
    """Remembers in Redis who was notified of what. Raises `StoreUnavailable` when it is away."""

    def __init__(self, client: RedisClient, patience_s: float, lease_s: float) -> None:
        self._scripts = Scripts(client)
        self._patience_ms = round(patience_s * 1000)
        self._lease_ms = round(lease_s * 1000)

    def to_tell(
        self, of_farm: Iterable[Trouble], of_store: Iterable[Trouble], targets: Iterable[str]
    ) -> list[tuple[str, str, Trouble]]:
        """The troubles to tell now: each with its target, and what `told` takes then."""
        targets, due = tuple(targets), []
        for scope, troubles in ((_FARM, of_farm), (socket.gethostname(), of_store)):
            found = _by_field(scope, targets, troubles)
            fields = self._scripts.run(
                NoteTroubles(
                    scope=scope,
                    found=tuple(found),
                    patience_ms=self._patience_ms,
                    lease_ms=self._lease_ms,
                )
            )
            due += [(field, *found[field]) for field in fields]
        return due

    def told(self, field: str) -> None:
        """Note that someone was notified of a trouble."""
        self._scripts.run(NoteTold(trouble=field))


def _by_field(
    scope: str, targets: Iterable[str], troubles: Iterable[Trouble]
) -> Mapping[str, tuple[str, Trouble]]:
    troubles = tuple(troubles)
    return {
        f"{scope} {target} {trouble.name}": (target, trouble)
        for target in targets
        for trouble in troubles
    }
