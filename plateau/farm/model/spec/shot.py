"""A batch that is a shot, frames that play one after another: a part of its spec."""

from typing import Final

from pydantic import Field

from plateau.farm.model.spec.rule_model import Strict

#: The fewest frames of a shot.
LEAST_FRAMES: Final = 2
#: The least width and height of one in pixels.
LEAST_SIDE: Final = 4


class ShotSpec(Strict):
    """The frames are judged as the video that they are."""

    fps: float = Field(ge=1, le=480, description="frames per second")
    target: float | None = Field(
        default=9.5,
        ge=1.0,
        le=9.99,
        description="quality against the converged shot that each moment of it is to have, in JOD: "
        "a frame ends once its own rule is satisfied and the moments at which it is seen are so "
        "good; null to judge the shot and give no frame more samples for it",
    )
