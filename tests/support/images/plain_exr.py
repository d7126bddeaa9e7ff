"""EXR files: of colour alone, as other programs write them, slices, and what a file says."""

import io
from typing import Any

import OpenEXR

from plateau.farm.images.exr import Attributes, Partial, Pixels, encode_layers


def encode_image(image: Pixels, attributes: Attributes | None = None) -> bytes:
    """A (height, width, 3) float32 image of linear Rec. 709 radiance as an EXR file."""
    planes = {name: image[..., plane] for plane, name in enumerate("RGB")}
    return encode_layers(planes, attributes or {})


def partial_of(pixels: Pixels, index: int = 0, **more: Any) -> Partial:
    """A slice of one seed, and of one sample per pixel unless it is told otherwise."""
    known: dict[str, Any] = {
        "job_id": "j",
        "first_seed": index,
        "last_seed": index,
        "spp": 1,
        "variant": "scalar_rgb",
        "scene_sha256": "0" * 64,
    }
    return Partial(index=index, pixels=pixels, **{**known, **more})


def header(content: bytes) -> dict[str, object]:
    """The attributes of an EXR file."""
    with OpenEXR.File(io.BytesIO(content), separate_channels=True) as file:
        return dict(file.header())
