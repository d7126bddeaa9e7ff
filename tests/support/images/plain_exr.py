"""EXR files of colour alone, as other programs write them, and what a file says of itself."""

import io

import OpenEXR

from plateau.farm.images.exr import Attributes, Pixels, encode_layers


def encode_image(image: Pixels, attributes: Attributes | None = None) -> bytes:
    """A (height, width, 3) float32 image of linear Rec. 709 radiance as an EXR file."""
    planes = {name: image[..., plane] for plane, name in enumerate("RGB")}
    return encode_layers(planes, attributes or {})


def header(content: bytes) -> dict[str, object]:
    """The attributes of an EXR file."""
    with OpenEXR.File(io.BytesIO(content), separate_channels=True) as file:
        return dict(file.header())
