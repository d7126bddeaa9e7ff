"""Commands that remember which troubles of the farm its operator was notified of."""

from dataclasses import dataclass

from plateau.farm.redis.commands.command import Command, Items


@dataclass(frozen=True, kw_only=True)
class NoteTroubles(Command[Items[str]]):
    """Note the troubles that there are, as ``SCOPE TARGET TROUBLE``; answers those to tell now."""

    scope: str  #: whose troubles these are all
    found: tuple[str, ...]
    patience_ms: int  #: for which a trouble lasts before anyone is notified
    lease_ms: int  #: for which its caller may tell it


@dataclass(frozen=True, kw_only=True)
class NoteTold(Command[None]):
    """Note that someone was notified of a trouble."""

    trouble: str
