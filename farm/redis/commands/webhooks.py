"""The outbox of webhooks, and the farm's secret that signs messages."""

from dataclasses import dataclass, field
from typing import Literal

from plateau.farm.redis.commands.command import Command

TryEnd = Literal["delivered", "failed", "given-up"]


@dataclass(frozen=True, kw_only=True)
class DueDelivery:
    """A delivery that is leased."""

    job: str
    number: int
    receiver: str
    url: str = field(repr=False)  #: "" where Redis has lost it, as for the next two
    secret: str = field(repr=False)
    spec: str  #: JSON
    sealed: dict[str, str]  #: the job's fields that workers cannot change
    tries: int
    now: str  #: ms
    delivery: str  #: JSON


@dataclass(frozen=True, kw_only=True)
class TakeDelivery(Command[DueDelivery | None]):
    """Lease the first due delivery."""

    token: str
    lease_ms: int
    busy: tuple[str, ...]  #: receivers


@dataclass(frozen=True, kw_only=True)
class SettleDelivery(Command[Literal["settled", "lost"]]):
    """Report how a try of a delivery ended."""

    job: str
    number: int
    token: str
    end: TryEnd
    delay_ms: int  #: until the next try
    status: int | None
    error: str
    ms: int  #: that it took


@dataclass(frozen=True, kw_only=True)
class Redeliver(Command[Literal["queued", "unknown"]]):
    """Have a delivery tried now."""

    job: str
    number: int


@dataclass(frozen=True, kw_only=True)
class FarmSecrets(Command[str]):
    """Answers the farm's secrets, newest first, with blanks between; this one if it has none."""

    secret: str = field(repr=False)


@dataclass(frozen=True, kw_only=True)
class RenewFarmSecret(Command[None]):
    """Give the farm another secret."""

    secret: str = field(repr=False)
    signs_for_ms: int  #: for which earlier ones still sign
    most: int  #: earlier ones that still sign
