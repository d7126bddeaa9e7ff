"""Parts of a job's spec: allocation, denoising, its shot, and how its EXR is written."""

from typing import Annotated, Final, Literal

from pydantic import Field

from plateau.farm.model.spec.rule_model import Strict

#: Zones begin at multiples of this many pixels, and are as large by default.
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
        default=_ALIGNMENT,
        ge=_ALIGNMENT,
        le=1024,
        multiple_of=_ALIGNMENT,
        description="side of a zone in pixels",
    )


class AutoAllocation(Strict):
    """Zones where the job can have them, else the frame: the job shows which, and why."""

    name: Literal["auto"] = "auto"


AllocationSpec = Annotated[
    AutoAllocation | FrameAllocation | ZonesAllocation, Field(discriminator="name")
]

#: Why an allocation `auto` became frame, as `SharedSpec.frames_because` says it.
FramesBecause = Literal["rule", "variance", "inputs", "shot", "keep_slices", "variant", "gpu"]


class NoDenoising(Strict):
    """The merged image is delivered as it is."""

    name: Literal["none"] = "none"


class OidnDenoising(Strict):
    """It is blended with what Open Image Denoise makes of it, where that has the smaller error."""

    name: Literal["oidn"] = "oidn"
    guides: bool = Field(
        default=True,
        description="whether the first films have albedo and normal too, which keep texture from "
        "being taken for noise",
    )


DenoiseSpec = Annotated[NoDenoising | OidnDenoising, Field(discriminator="name")]


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


#: Those without loss: the ids and the depth of an image are to be exact, and so is its remake.
Compression = Literal["none", "rle", "zips", "zip", "piz"]


class ExrSpec(Strict):
    """How image.exr is written."""

    precision: Literal["float", "half"] = Field(
        default="float",
        description="of its values; ids and Z are float in either, and half ends at 65504",
    )
    compression: Compression = Field(
        default="zip", description="of the final file, without loss; zips and none read fastest"
    )
