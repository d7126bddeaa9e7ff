"""Commands that begin sweeps, and remove finished jobs and their sums."""

from typing import Literal

from plateau.farm.redis.commands.command import Command


class BeginSweep(Command[bool]):
    """Begin a sweep, unless one was begun within this time."""

    every_ms: int


class NoteSweep(Command[None]):
    """Note that a sweep has ended."""


class Forget(Command[Literal["forgotten", "kept", "missing"]]):
    """Forget a finished job: one that finished, or was deleted, this long ago."""

    job: str
    finished_for_ms: int | None = None
    deleted_for_ms: int | None = None


class DropSums(Command[Literal["dropped", "kept"]]):
    """Drop the sums of a job that finished this long ago."""

    job: str
    finished_for_ms: int
    continued_by: tuple[str, ...]  #: the known jobs that continue it
