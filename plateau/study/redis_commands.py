"""Commands for observer studies: create, join, answer and forget them."""

from dataclasses import dataclass
from typing import Literal

from plateau.farm.redis.commands.command import Command


class BeginStudy(Command[None]):
    """Let the pictures of a study be put."""

    study: str
    making_ms: int  #: the time for it


@dataclass(frozen=True, kw_only=True)
class MadeStudy:
    """The answer to a request for a study."""

    outcome: Literal["created", "repeated", "late", "too many"]
    study: str = ""


class CreateStudy(Command[MadeStudy]):
    """Show a study whose pictures have been put."""

    study: str
    digest: str  #: of the request and its owner
    owner: str  #: or ""
    about: str  #: JSON
    most: int  #: studies that are allowed


class JoinStudy(Command[Literal["joined", "known", "full", "missing"]]):
    """Take part in a study."""

    study: str
    name: str  #: a pseudonym
    screen: str  #: JSON
    most: int  #: observers that are allowed


class AnswerStudy(Command[str | None]):
    """Note an observer's answer to a pair; answers the stored one, which counts."""

    study: str
    name: str
    trial: int  #: the pair's number
    given: str  #: JSON


class ForgetStudy(Command[None]):
    """Forget a study with its observers and answers."""

    study: str
