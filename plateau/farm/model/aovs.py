"""Arbitrary output variables (AOVs): what a job may ask for besides colour, and as which channels.

A renderer need not have all of them. Which ones it has is in its package in
`plateau.worker.renderers`; a scene that asks for another is refused there.
"""

from dataclasses import dataclass
from typing import Final, Literal, get_args

#: An AOV, by the name that a job's spec gives it.
AovName = Literal["albedo", "normal", "depth", "position", "uv", "shape_id", "primitive_id"]

#: All of them, in the order in which messages and the page list them.
AOV_NAMES: Final[tuple[AovName, ...]] = get_args(AovName)


@dataclass(frozen=True)
class Aov:
    """What an AOV is.

    Attributes
    ----------
    channels : tuple of str
        Its channels, by the names that compositors expect in an EXR file.
    meaning : str
        What a pixel has, with its unit or frame, for the help and the page.
    is_id : bool
        Whether its values are the numbers of things, not averaged: the first sample counts.
    """

    channels: tuple[str, ...]
    meaning: str
    is_id: bool = False


AOVS: Final[dict[AovName, Aov]] = {
    "albedo": Aov(("albedo.R", "albedo.G", "albedo.B"), "reflectance of the surface, linear RGB"),
    "normal": Aov(("N.X", "N.Y", "N.Z"), "shading normal, in world space"),
    "depth": Aov(("Z",), "distance from the camera, in units of the scene"),
    "position": Aov(("P.X", "P.Y", "P.Z"), "point on the surface, in world space"),
    "uv": Aov(("uv.U", "uv.V"), "texture coordinates"),
    "shape_id": Aov(("id.shape",), "number of the shape", is_id=True),
    "primitive_id": Aov(("id.primitive",), "number of the triangle in its shape", is_id=True),
}

#: AOVs that tell a denoiser what is texture and what is noise.
GUIDES: Final[tuple[AovName, ...]] = ("albedo", "normal")
#: Samples per pixel that have them: enough that they hardly have noise.
GUIDED_SPP: Final = 64
