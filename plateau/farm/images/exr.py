"""EXR files: partials, which merge by addition, and images."""

from __future__ import annotations

import io
import json
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from plateau.farm.images.channels import Channels
from plateau.farm.images.crops import windows
from plateau.farm.images.layers import read_layer
from plateau.farm.images.mattes import attributes_of
from plateau.farm.images.view_transform import ViewTransform
from plateau.farm.model.errors import CorruptPartial
from plateau.farm.model.slices.zones import Zone

# A render child, which cannot open the rules that specs know, reads films too.
if TYPE_CHECKING:
    from plateau.farm.model.spec.parts import Compression

Pixels = NDArray[np.float32]
#: The attributes of a file's header, by name.
Attributes = Mapping[str, Any]

_COMPRESSIONS: Final[dict[Compression, Any]] = {
    "none": OpenEXR.NO_COMPRESSION,
    "rle": OpenEXR.RLE_COMPRESSION,
    "zips": OpenEXR.ZIPS_COMPRESSION,
    "zip": OpenEXR.ZIP_COMPRESSION,
    "piz": OpenEXR.PIZ_COMPRESSION,
}
#: The first bytes of every EXR file.
_MAGIC: Final = b"v/1\x01"
_LARGEST_HALF: Final = 65504.0

#: Fields of a partial, each with its attribute and its types there and here: an integer of EXR is
#: signed, a seed is not.
_FACTS: Final[tuple[tuple[str, str, type, type], ...]] = (
    ("job_id", "plateau:job", str, str),
    ("index", "plateau:slice", int, int),
    ("first_seed", "plateau:first_seed", str, int),
    ("last_seed", "plateau:last_seed", str, int),
    ("spp", "plateau:spp", int, int),
    ("variant", "plateau:variant", str, str),
    ("scene_sha256", "plateau:scene_sha256", str, str),
)
_CHANNELS: Final = "plateau:channels"
_IDS: Final = "plateau:ids"
_QUOTIENTS: Final = "plateau:quotients"
_ZONES: Final = "plateau:zones"
_BORDER: Final = "plateau:border"
_RENDERER: Final = "plateau:renderer"
_LOOK: Final = "plateau:look"
_INPUTS: Final = "plateau:inputs"


@dataclass(frozen=True, kw_only=True)
class Partial:
    """One slice's film before normalisation.

    `pixels` is (height, width, channels) float32, in the order of `channels`. A slice of `zones`
    has (pixels, channels) instead: zone after zone, each with its `border` and row by row.
    `renderer` is the renderer's name and version. The first slice of a job has the scene's view
    transform as `transform`, and what an image's header is to say of its Cryptomattes and of its
    place in a film as `header`; and the sums of its first passes as `inputs`, by their spp.
    """

    job_id: str
    index: int
    first_seed: int
    last_seed: int
    spp: int
    variant: str
    scene_sha256: str
    pixels: Pixels
    channels: Channels = field(default_factory=Channels)
    zones: tuple[Zone, ...] = ()
    border: int = 0
    renderer: str = ""
    transform: ViewTransform | None = None
    header: Attributes = field(default_factory=dict)
    inputs: Mapping[int, Pixels] = field(default_factory=dict)


def encode_partial(partial: Partial) -> bytes:
    """Return a partial as an EXR file, uncompressed: ZIP shrinks noise by 0.5 %."""
    attributes = {name: kept(getattr(partial, own)) for own, name, kept, _ in _FACTS}
    names = partial.channels.names
    # An EXR file sorts its channels by name, so their order is an attribute.
    attributes |= {_CHANNELS: json.dumps(names), _IDS: json.dumps(partial.channels.ids)}
    attributes[_QUOTIENTS] = json.dumps(partial.channels.quotients)
    if partial.renderer:
        attributes[_RENDERER] = partial.renderer
    if partial.transform is not None:
        attributes[_LOOK] = partial.transform.as_text()
    attributes |= partial.header
    pixels = partial.pixels
    if partial.zones:
        attributes |= {_ZONES: json.dumps(partial.zones), _BORDER: partial.border}
        pixels = pixels[None]  # as one row
    planes = {name: pixels[..., plane] for plane, name in enumerate(names)}
    for spp, film in partial.inputs.items():
        planes |= {
            f"{input_layer(spp)}.{name}": film[..., plane] for plane, name in enumerate(names)
        }
    if partial.inputs:
        attributes[_INPUTS] = json.dumps(list(partial.inputs))
    return _encode(planes, "none", attributes)


def input_layer(spp: int) -> str:
    """Return the name of the layer with the image of so many samples per pixel."""
    return f"spp{spp:04d}"


def decode_partial(content: bytes) -> Partial:
    """Return the partial in an EXR file.

    Raises
    ------
    CorruptPartial
        The content is no EXR file, is cut short, or lacks a channel or an attribute.
    """
    try:
        with OpenEXR.File(io.BytesIO(content), separate_channels=True) as file:
            planes = file.channels()
            header = dict(file.header())
            named = (json.loads(header[name]) for name in (_CHANNELS, _IDS, _QUOTIENTS))
            channels = Channels(*named)

            def film(layer: str = "") -> Pixels:
                return np.stack([planes[f"{layer}{one}"].pixels for one in channels.names], axis=-1)

            pixels, spps = film(), json.loads(header.get(_INPUTS, "[]"))
            inputs = {int(spp): film(f"{input_layer(spp)}.") for spp in spps}
            zones = tuple(Zone(*map(int, one)) for one in json.loads(header.get(_ZONES, "[]")))
            border = int(header.get(_BORDER, 0))
            transform = ViewTransform.from_text(str(header[_LOOK])) if _LOOK in header else None
        facts = {own: of_type(header[name]) for own, name, _, of_type in _FACTS}
    except (RuntimeError, KeyError, ValueError, TypeError) as error:
        raise CorruptPartial(f"not a partial: {error}") from error
    return Partial(
        **facts,
        pixels=pixels[0] if zones else pixels,
        channels=channels,
        zones=zones,
        border=border,
        transform=transform,
        header=attributes_of(header),
        renderer=str(header.get(_RENDERER, "")),
        inputs=inputs,
    )


def encode_layers(
    planes: Mapping[str, Pixels],
    attributes: Attributes,
    *,
    precision: Literal["float", "half"] = "float",
    compression: Compression = "zip",
    whole: Collection[str] = (),
) -> bytes:
    """Return the channels of an image as an EXR file.

    Parameters
    ----------
    planes
        (height, width) float32 by channel.
    attributes
        Attributes of the header; those of a crop give it its windows.
    precision
        "half" has 11 significant bits, and clips finite values at ±65504.
    compression
        A lossless compression.
    whole
        Channels that stay float32 in a half file.
    """
    height, width = next(iter(planes.values())).shape
    attributes = {**attributes, **windows(attributes, width, height)}
    if precision == "half":
        planes = {name: one if name in whole else _as_half(one) for name, one in planes.items()}
    return _encode(planes, compression, attributes)


def _as_half(values: Pixels) -> NDArray[Any]:
    cut = np.clip(values, -_LARGEST_HALF, _LARGEST_HALF)
    return np.where(np.isinf(values), values, cut).astype(np.float16)


def decode_layers(content: bytes) -> dict[str, Pixels]:
    """Return each channel of an EXR file, of all its parts: (height, width) float32 by name.

    Raises
    ------
    ValueError
        The content is no EXR file, or a damaged one.
    """
    with _opened(content) as file:
        return {
            name: one.pixels.astype(np.float32)
            for part in file.parts
            for name, one in part.channels.items()
        }


def decode_header(content: bytes) -> dict[str, Any]:
    """Return the attributes of an EXR file's first part by name; raises as `decode_layers`."""
    with _opened(content) as file:
        return dict(file.header())


def decode_image(content: bytes, layer: str | None = None) -> Pixels:
    """Return a layer of an EXR file as (height, width, 3) float32, as `images.layers` chooses it.

    Half and float channels are read; a lone luminance channel ``Y`` becomes grey. Alpha is left
    out: a transparent image has premultiplied colours, which are its colours over black.

    Raises
    ------
    ValueError
        The content is no EXR file, is damaged, or has no such layer.
    """
    with _opened(content) as file:
        return read_layer(file, layer)


@contextmanager
def _opened(content: bytes) -> Iterator[OpenEXR.File]:
    """Open an EXR file; whatever OpenEXR raises for a damaged one becomes a ValueError in words."""
    if not content.startswith(_MAGIC):
        raise ValueError("it is not an EXR file")
    damaged = "the EXR file is damaged or cut short"
    try:
        opened = OpenEXR.File(io.BytesIO(content), separate_channels=True)
    except (RuntimeError, MemoryError, ValueError) as error:
        raise ValueError(f"{damaged}: {error}") from error
    with opened as file:
        try:
            yield file
        except (RuntimeError, MemoryError, UnicodeDecodeError) as error:
            raise ValueError(f"{damaged}: {error}") from error


def _encode(
    planes: Mapping[str, NDArray[Any]], compression: Compression, attributes: Attributes
) -> bytes:
    header = {
        "compression": _COMPRESSIONS[compression],
        "type": OpenEXR.scanlineimage,
        **attributes,
    }
    channels = {
        name: np.ascontiguousarray(values, np.float16 if values.dtype == np.float16 else np.float32)
        for name, values in planes.items()
    }
    stream = io.BytesIO()
    with OpenEXR.File(header, channels) as file:
        file.write(stream)
    return stream.getvalue()
