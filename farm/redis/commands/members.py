"""Monitors and APIs say that they live; workers are drained; Redis and blob store are paired."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from plateau.farm.redis.commands.command import Command


@dataclass(frozen=True, kw_only=True)
class MonitorHeartbeat(Command[None]):
    """Say that a monitor lives, and what it has done since it started."""

    monitor: str
    about: str | None  #: JSON; None where it signs off
    life_ms: int  #: after that it is taken for dead
    done: Mapping[str, int]  #: by total


@dataclass(frozen=True, kw_only=True)
class ApiHeartbeat(Command[None]):
    """Say that an API lives."""

    api: str
    about: str | None  #: JSON; None where it signs off
    life_ms: int


@dataclass(frozen=True, kw_only=True)
class Drain(Command[Literal["drained", "working", "missing"]]):
    """Tell a worker to take no more slices, or to take some again."""

    worker: str
    drains: bool
    alive_ms: int  #: it lives if it was heard of within this time


@dataclass(frozen=True, kw_only=True)
class Pair(Command[str]):
    """Give Redis the id that it shares with its blob store; the one that it has is answered."""

    id: str
    is_marked: bool  #: whether the blob store has it
