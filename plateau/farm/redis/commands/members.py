"""Heartbeats of workers and monitors, draining of workers, pairing of Redis and blob store."""

from dataclasses import dataclass
from typing import Literal

from plateau.farm.redis.commands.command import Command, Items


class MonitorHeartbeat(Command[None]):
    """Report that a monitor lives."""

    monitor: str
    jobs: int | None  #: that it owns; None where it signs off
    life_ms: int  #: after this time without a heartbeat it counts as dead


class Drain(Command[Literal["drained", "working", "missing"]]):
    """Tell a worker to take no more slices, or to take some again."""

    worker: str
    drains: bool
    alive_ms: int  #: after this time without a heartbeat it counts as dead


class Pair(Command[str]):
    """Give Redis the id that it shares with its blob store; answers the id that it has now."""

    id: str
    is_marked: bool  #: whether the blob store has it


@dataclass(frozen=True)
class LeaseName:
    """The name of a lease: the job, and the entry of its stream."""

    job: str
    entry: str


class Heartbeat(Command[Items[LeaseName]]):
    """Report that a worker lives, and renew its leases; answers the lost ones."""

    worker: str
    about: str  #: JSON
    lease_ms: int
    leases: tuple[LeaseName, ...]


class Leave(Command[None]):
    """Sign a worker off."""

    worker: str
