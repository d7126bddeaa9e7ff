"""How a job's samples are spread over its image: a part of its spec."""

from typing import Annotated, Final, Literal

from pydantic import Field

from plateau.farm.model.spec.rule_model import Strict

#: Zones begin at multiples of this many pixels.
_ALIGNMENT: Final = 16
#: The first rounds, which are steps of whole films: the image of round k decides round k + LAG.
LAG: Final = 2


class FrameAllocation(Strict):
    """Every pixel has the same samples."""

    name: Literal["frame"] = "frame"


class ZonesAllocation(Strict):
    """Zones in which more is left to see have more samples."""

    name: Literal["zones"] = "zones"
    size: int = Field(
        default=16,
        ge=_ALIGNMENT,
        le=1024,
        multiple_of=_ALIGNMENT,
        description="side of a zone in pixels",
    )


AllocationSpec = Annotated[FrameAllocation | ZonesAllocation, Field(discriminator="name")]
