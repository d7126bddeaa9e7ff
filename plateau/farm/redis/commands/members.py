"""Heartbeats of monitors, draining of workers, pairing of Redis and blob store."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from plateau.farm.redis.commands.command import Command


@dataclass(frozen=True, kw_only=True)
class MonitorHeartbeat(Command[None]):
    """Report that a monitor lives, and its work since its start."""

    monitor: str
    about: str | None  #: JSON; None where it signs off
    life_ms: int  #: after this time without a heartbeat it counts as dead
    done: Mapping[str, int]  #: by total


@dataclass(frozen=True, kw_only=True)
class Drain(Command[Literal["drained", "working", "missing"]]):
    """Tell a worker to take no more slices, or to take some again."""

    worker: str
    drains: bool
    alive_ms: int  #: after this time without a heartbeat it counts as dead


@dataclass(frozen=True, kw_only=True)
class Pair(Command[str]):
    """Give Redis the id that it shares with its blob store; answers the id that it has now."""

    id: str
    is_marked: bool  #: whether the blob store has it
