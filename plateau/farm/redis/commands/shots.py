"""The command of shots, whose frames are judged as a video."""

from dataclasses import dataclass
from typing import Literal

from plateau.farm.redis.commands.command import Command

#: How a shot is after its last look, as `plateau.farm.model.shot.Shot` has it.
Over = Literal["good", "short", "judged", "not judged"]


@dataclass(frozen=True)
class AnsweredFrame:
    """A frame, and what a look said to it."""

    job: str
    answer: str  #: JSON of a `plateau.farm.model.shot.FrameAnswer`; "": it waits no more


class AnswerFrames(Command[Literal["answered", "known"]]):
    """Note a look at a shot, once, and what it said to frames."""

    shot: str
    number: int  #: of the look, from 0 on
    look: str | None  #: JSON of a `plateau.farm.model.shot.ShotLook`; None: it could not be judged
    why: str  #: what it said, in words
    over: Over | None  #: if it was the last one
    answers: tuple[AnsweredFrame, ...]
