"""The outbox: notices of ended jobs, and of troubles, on their way to who is to hear of them."""

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


class TakeNotice(Command[DueNotice | None]):
    """Lease the first due notice."""

    token: str
    lease_ms: int
    busy: tuple[str, ...]  #: receivers


class SettleNotice(Command[Literal["settled", "lost"]]):
    """Report how a try of a notice ended."""

    job: str
    receiver: str
    token: str
    end: TryEnd
    error: str
    delay_ms: int  #: until the next try


class NoteTroubles(Command[Items[str]]):
    """Note the troubles that there are, as ``SCOPE TARGET TROUBLE``; answers those to tell now."""

    scope: str  #: whose troubles these are all
    found: tuple[str, ...]
    patience_ms: int  #: for which a trouble lasts before anyone is notified
    lease_ms: int  #: for which its caller may tell it


class NoteTold(Command[None]):
    """Note that someone was notified of a trouble."""

    trouble: str
