"""A shot: a batch whose frames are judged as the video that they are, in one look after another.

A frame *waits* once its own rule is satisfied, or its cap is reached. When all of them wait, the
shot is looked at. Then either some frames are asked for more samples, or all of them may end.
"""

from datetime import datetime
from typing import Literal

from pydantic import Field

from plateau.farm.model.record import Record
from plateau.farm.model.states import JobState


class FrameWait(Record):
    """An image with which a frame waits for a look at its shot, and what its own rule said."""

    spp: int
    stop: bool = Field(description="whether its rule is satisfied; otherwise its cap is reached")
    reason: str
    numbers: dict[str, float | None]


class FrameAnswer(Record):
    """What a look at the shot said to one of its frames."""

    spp: int = Field(description="samples per pixel of the image that was looked at")
    needs_spp: int | None = Field(description="before which it is not to end; null if it may end")
    good: bool = Field(description="whether the shot is as good as its target asks")
    words: str


class FrameOfShot(Record):
    """The place of a job in the shot that it is a frame of."""

    id: str = Field(description="the shot: the id of its first frame")
    waits: FrameWait | None = None
    answer: FrameAnswer | None = None

    @property
    def is_waiting(self) -> bool:
        """Whether it waits, and no look has answered."""
        waits, answer = self.waits, self.answer
        if waits is None or self.may_end(waits.spp):
            return False
        return answer is None or answer.spp < waits.spp

    def may_end(self, spp: int) -> bool:
        """Return whether a look has allowed it to end with an image of these samples."""
        answer = self.answer
        return answer is not None and answer.needs_spp is None and spp >= answer.spp

    def must_go_on(self, spp: int) -> bool:
        """Return whether the last look has asked for more than these samples."""
        answer = self.answer
        if answer is None:
            return False
        return spp < (answer.spp if answer.needs_spp is None else answer.needs_spp)


class ShotLook(Record):
    """One judgement of a shot; frames and moments are in the order of the frames, from 0 on."""

    at: datetime
    spp: tuple[int, ...] = Field(description="samples per pixel of each frame")
    jod: float = Field(description="quality against the converged shot, estimated, in JOD")
    low_jod: float = Field(description="it is at least this in about nine cases of ten")
    frames: tuple[float, ...] = Field(
        description="what the shot would have if each moment were as this one; the eye answers an "
        "eighth of a second late"
    )
    low_frames: tuple[float, ...] = Field(description="each is at least this, as above")
    worst_frame: int = Field(description="the frame that is seen most at the worst moment")
    asked: tuple[int, ...] = Field(description="frames that were asked for more samples")
    seconds: float = Field(description="how long it took")
    flicker_sha256: str | None = Field(None, description="of the map of where noise is seen")


class Shot(Record):
    """The newest shot of a batch."""

    id: str = Field(description="the id of its first frame")
    fps: float = Field(description="frames per second")
    target: float | None = Field(description="the quality that each moment is to have, in JOD")
    frames: int = Field(description="how many it has")
    state: Literal["rendering", "judging", "good", "short", "judged", "not judged"] = Field(
        description="rendering: not all frames wait; judging: they do; good: each moment has the "
        "target; short: frames have reached their caps before; judged: it has no target; not "
        "judged: it ended without a look, and `why` says why"
    )
    why: str = Field("", description="what the last look said, in words")
    waiting: int = Field(description="frames that wait for the next look, or have ended")
    looks: int = Field(description="how often it was judged")
    spp: float | None = Field(None, description="mean samples per pixel of the last look's frames")
    jod: float | None = Field(None, description="quality at the last look")
    low_jod: float | None = Field(None, description="it is at least this")
    low_moment_jod: float | None = Field(None, description="the worst moment has at least this")
    worst_frame: int | None = Field(None, description="the frame that is seen most at that moment")


class ShotFrame(Record):
    """A frame of a shot."""

    job: str = Field(description="its id")
    state: JobState | None = Field(description="null of one that is deleted")
    spp: int = Field(description="samples per pixel of its merged image")
    waits: bool = Field(description="whether it waits for the next look at the shot")
    needs_spp: int | None = Field(
        None, description="samples per pixel that the last look has asked of it"
    )


class ShotByFrame(Shot):
    """A shot frame by frame, and each judgement of it."""

    by_frame: tuple[ShotFrame, ...] = Field(description="in their order")
    judged: tuple[ShotLook, ...] = Field(description="each look at it, in their order")
