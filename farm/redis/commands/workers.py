"""Workers say that they live, that they leave, and that they were refused."""

from dataclasses import dataclass

from plateau.farm.redis.commands.command import Command, Items


@dataclass(frozen=True)
class LeaseName:
    """Which lease it is: the job, and the entry of its stream."""

    job: str
    entry: str


@dataclass(frozen=True, kw_only=True)
class Heartbeat(Command[Items[LeaseName]]):
    """Say that a worker lives, and renew its leases; those that it has lost are answered."""

    worker: str
    about: str  #: JSON
    lease_ms: int
    leases: tuple[LeaseName, ...]


@dataclass(frozen=True, kw_only=True)
class Leave(Command[None]):
    """Sign a worker off."""

    worker: str


@dataclass(frozen=True, kw_only=True)
class Refused(Command[None]):
    """Note that a process was refused."""

    who: str  #: role and machine
    about: str  #: JSON
