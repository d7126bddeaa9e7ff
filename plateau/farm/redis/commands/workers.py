"""Commands of workers: they report that they live, or leave."""

from dataclasses import dataclass

from plateau.farm.redis.commands.command import Command, Items


@dataclass(frozen=True)
class LeaseName:
    """The name of a lease: the job, and the entry of its stream."""

    job: str
    entry: str


@dataclass(frozen=True, kw_only=True)
class Heartbeat(Command[Items[LeaseName]]):
    """Report that a worker lives, and renew its leases; answers the lost ones."""

    worker: str
    about: str  #: JSON
    lease_ms: int
    leases: tuple[LeaseName, ...]


@dataclass(frozen=True, kw_only=True)
class Leave(Command[None]):
    """Sign a worker off."""

    worker: str
