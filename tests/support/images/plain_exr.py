"""EXR files of colour alone, as other programs write them."""

from plateau.farm.images.exr import Attributes, Pixels, encode_layers


def encode_image(image: Pixels, attributes: Attributes | None = None) -> bytes:
    """A (height, width, 3) float32 image of linear Rec. 709 radiance as an EXR file."""
    planes = {name: image[..., plane] for plane, name in enumerate("RGB")}
    return encode_layers(planes, attributes or {})
