"""The workers that live, are drained and are resumed; and the heartbeat of monitors."""

from typing import Final

from plateau.farm.ledger import records
from plateau.farm.model.errors import WorkerNotFound
from plateau.farm.model.worker import Worker
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.members import Drain, MonitorHeartbeat
from plateau.farm.redis.link import now_ms
from plateau.farm.redis.scripts import OnRedis, Scripts

#: A worker lives for this long after its last heartbeat.
ALIVE_S: Final = 15.0


class Workers(OnRedis):
    """The workers that live. Every method raises `StoreUnavailable` when Redis is away."""

    def living(self, within_s: float = ALIVE_S) -> list[Worker]:
        """The workers that sent a heartbeat in the last `within_s` seconds."""
        now = now_ms(self._redis)
        alive = self._redis.zrangebyscore(keys.WORKERS, now - within_s * 1000, "+inf")
        pipe = self._redis.pipeline(transaction=False)
        for worker_id in alive:
            pipe.hgetall(keys.worker(worker_id))
        read = (records.worker(fields, now) for fields in pipe.execute())
        return [worker for worker in read if worker is not None]

    def drain(self, worker_id: str) -> None:
        """Give the worker no more slices; it finishes those that it has. Harmless to repeat.

        A restarted worker has another id, and is not drained.

        Raises
        ------
        WorkerNotFound
            No such worker lives.
        """
        self._tell(worker_id, drains=True)

    def resume(self, worker_id: str) -> None:
        """Let a drained worker take work again; raises `WorkerNotFound` as `drain` does."""
        self._tell(worker_id, drains=False)

    def _tell(self, worker_id: str, *, drains: bool) -> None:
        drain = Drain(worker=worker_id, drains=drains, alive_ms=round(ALIVE_S * 1000))
        if self._scripts.run(drain) == "missing":
            raise WorkerNotFound(worker_id)


class MonitorLife:
    """A monitor's heartbeat: it counts as alive for the length of a lease after the last one."""

    def __init__(self, client: RedisClient, monitor_id: str, lease_s: float) -> None:
        self._scripts = Scripts(client)
        self._id = monitor_id
        self._lease_ms = round(lease_s * 1000)

    def heartbeat(self, jobs: int | None) -> None:
        """Report that the monitor lives, and the number of its jobs; None for the last time."""
        self._scripts.run(MonitorHeartbeat(monitor=self._id, jobs=jobs, life_ms=self._lease_ms))
