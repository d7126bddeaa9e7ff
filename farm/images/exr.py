"""EXR files: partials, which can be added, and images, which can be looked at."""

import io
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from plateau.farm.images.layers import read_layer
from plateau.farm.model.errors import CorruptPartial

Pixels = NDArray[np.float32]

_PARTIAL_CHANNELS: Final = ("R", "G", "B", "W")
_ATTRIBUTES: Final[dict[str, type]] = {
    "job": str,
    "slice": int,
    "first_seed": int,
    "last_seed": int,
    "spp": int,
    "variant": str,
    "scene_sha256": str,
}


@dataclass(frozen=True, kw_only=True)
class Partial:
    """One slice's film before normalisation.

    `pixels` is (height, width, 4) float32: the sums of filter-weighted R, G, B radiance, and of
    the filter weights W. So partials merge by addition, with any reconstruction filter.
    """

    job_id: str
    index: int
    first_seed: int
    last_seed: int
    spp: int
    variant: str
    scene_sha256: str
    pixels: Pixels


def encode_partial(partial: Partial) -> bytes:
    """The partial as an EXR file, uncompressed: noise does not shrink (0.5 % with ZIP)."""
    values = (
        partial.job_id,
        partial.index,
        str(partial.first_seed),  # EXR integers are signed, seeds are not
        str(partial.last_seed),
        partial.spp,
        partial.variant,
        partial.scene_sha256,
    )
    attributes = {f"plateau:{name}": value for name, value in zip(_ATTRIBUTES, values, strict=True)}
    return _encode(partial.pixels, _PARTIAL_CHANNELS, OpenEXR.NO_COMPRESSION, attributes)


def decode_partial(content: bytes) -> Partial:
    """The partial in an EXR file.

    Raises
    ------
    CorruptPartial
        It is no EXR file, is cut short, or lacks a channel or an attribute.
    """
    try:
        with OpenEXR.File(io.BytesIO(content), separate_channels=True) as file:
            channels = file.channels()
            header = dict(file.header())
            pixels = np.stack([channels[name].pixels for name in _PARTIAL_CHANNELS], axis=-1)
        job, index, first, last, spp, variant, scene = (
            of_type(header[f"plateau:{name}"]) for name, of_type in _ATTRIBUTES.items()
        )
    except (RuntimeError, KeyError, ValueError, TypeError) as error:
        raise CorruptPartial(f"not a partial: {error}") from error
    return Partial(
        job_id=job,
        index=index,
        first_seed=first,
        last_seed=last,
        spp=spp,
        variant=variant,
        scene_sha256=scene,
        pixels=pixels,
    )


def encode_image(
    image: Pixels, attributes: dict[str, str | int] | None = None, *, compressed: bool = True
) -> bytes:
    """An (height, width, 3) float32 image of linear Rec. 709 radiance as an EXR file.

    Compression (ZIP, without loss) takes ten times as long, for a few percent of a noisy image and
    much of a flat background.
    """
    compression = OpenEXR.ZIP_COMPRESSION if compressed else OpenEXR.NO_COMPRESSION
    return _encode(image, ("R", "G", "B"), compression, attributes or {})


def decode_image(content: bytes, layer: str | None = None) -> Pixels:
    """A layer of an EXR file as (height, width, 3) float32, as `images.layers` chooses it.

    Half and float channels are read; a lone luminance channel ``Y`` becomes grey. Colours of a
    transparent image are premultiplied, so they are those over black, and alpha is left out.

    Raises
    ------
    ValueError
        It is no EXR file, is damaged, or has no such layer.
    """
    try:
        with OpenEXR.File(io.BytesIO(content), separate_channels=True) as file:
            return read_layer(file, layer)
    except (RuntimeError, MemoryError, UnicodeDecodeError) as error:
        raise ValueError(f"the EXR file is damaged or cut short: {error}") from error


def _encode(
    pixels: Pixels,
    names: tuple[str, ...],
    compression: Any,
    attributes: dict[str, Any],
) -> bytes:
    header = {"compression": compression, "type": OpenEXR.scanlineimage, **attributes}
    channels = {
        name: np.ascontiguousarray(pixels[..., plane], dtype=np.float32)
        for plane, name in enumerate(names)
    }
    stream = io.BytesIO()
    with OpenEXR.File(header, channels) as file:
        file.write(stream)
    return stream.getvalue()
