"""The outbox: notices of ended jobs on their way to who is to hear of it."""

from dataclasses import dataclass, field
from typing import Literal

from plateau.farm.redis.commands.command import Command, Items

TryEnd = Literal["delivered", "failed", "given-up"]


@dataclass(frozen=True, kw_only=True)
class DueNotice:
    """A notice that is leased."""

    job: str
    receiver: str
    tries: int
    now: str  #: ms
    fields: Items[str] = field(repr=False)  #: names and values of the job's hash,
    sealed: Items[str] = field(repr=False)  #: and of the one that workers cannot change


@dataclass(frozen=True, kw_only=True)
class TakeNotice(Command[DueNotice | None]):
    """Lease the first due notice."""

    token: str
    lease_ms: int
    busy: tuple[str, ...]  #: receivers


@dataclass(frozen=True, kw_only=True)
class SettleNotice(Command[Literal["settled", "lost"]]):
    """Report how a try of a notice ended."""

    job: str
    receiver: str
    token: str
    end: TryEnd
    error: str
    delay_ms: int  #: until the next try
