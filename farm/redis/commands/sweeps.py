"""Sweeps, and what they remove of finished jobs."""

from dataclasses import dataclass
from typing import Literal

from plateau.farm.redis.commands.command import Command


@dataclass(frozen=True, kw_only=True)
class BeginSweep(Command[bool]):
    """Begin a sweep, unless one was begun within this time."""

    every_ms: int


@dataclass(frozen=True, kw_only=True)
class NoteSweep(Command[None]):
    """Note that a sweep was done."""


@dataclass(frozen=True, kw_only=True)
class Forget(Command[Literal["forgotten", "kept", "missing"]]):
    """Forget a job that has been finished for so long."""

    job: str
    finished_for_ms: int


@dataclass(frozen=True, kw_only=True)
class DropSums(Command[Literal["dropped", "kept"]]):
    """Let the sums go of a job that has been finished for so long."""

    job: str
    finished_for_ms: int
    continued_by: tuple[str, ...]  #: the jobs that go on with it, as far as they are known
