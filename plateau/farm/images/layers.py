"""Which channels of an EXR file make a picture.

A file has parts, a part has channels, and a channel is called ``LAYER.R`` or plainly ``R``. A layer
here is whatever has R, G and B, or Y alone: the plain channels of a part go by the part's name, or
by none in a file of one part.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from plateau.farm.images.crops import CROP

#: What may stand beside a luminance Y; X, Y and Z are a vector.
_OF_LUMINANCE = {"Y", "A", "RY", "BY"}
#: A layer's channels by their last letter.
Planes = dict[str, "NDArray[Any]"]


def read_layer(file: OpenEXR.File, name: str | None) -> NDArray[np.float32]:
    """Return a layer as (height, width, 3) float32, in the display window, or in the crop.

    Parameters
    ----------
    file
        Open, with its channels apart.
    name
        The layer; None for the plain R, G, B or Y of the first part, or for the only layer.

    Raises
    ------
    ValueError
        There is no such layer, or several and none of them plain; or it holds luminance and chroma.
    """
    layers = dict(_layers(file.parts))
    if name is None:
        name = "" if "" in layers or len(layers) != 1 else next(iter(layers))
    if name not in layers:
        raise ValueError(_no_layer(name, layers, file))
    planes, header = layers[name]
    if {"RY", "BY"} & planes.keys():
        raise ValueError("its channels are luminance and chroma (Y, RY, BY): save it as R, G and B")
    names = "RGB" if "R" in planes else "YYY"
    image = np.stack([planes[each].astype(np.float32) for each in names], axis=-1)
    return _in_display_window(image, header)


def _layers(parts: list[Any]) -> Iterator[tuple[str, tuple[Planes, Mapping[str, Any]]]]:
    for number, part in enumerate(parts):
        if "deep" in str(part.type()):
            continue
        found: dict[str, Planes] = {}
        for full, channel in part.channels.items():
            layer, _, letter = full.rpartition(".")
            found.setdefault(layer, {})[letter] = channel.pixels
        for layer, planes in found.items():
            if {"R", "G", "B"} <= planes.keys() or "Y" in planes.keys() <= _OF_LUMINANCE:
                # The first part's plain channels are the picture itself.
                part_name = part.name() if number else ""
                yield ".".join(filter(None, (part_name, layer))), (planes, part.header)


def _no_layer(name: str, layers: Mapping[str, object], file: OpenEXR.File) -> str:
    if layers:
        known = ", ".join(each or "the plain R, G, B" for each in layers)
        return (
            f"it has no layer {name!r}; it has {known}"
            if name
            else (f"it has no plain R, G, B, but layers: choose one of {known} with --layer")
        )
    channels = sorted({channel for part in file.parts for channel in part.channels})
    return f"the EXR file has no R, G and B channels, only {', '.join(channels) or 'deep ones'}"


def _in_display_window(
    image: NDArray[np.float32], header: Mapping[str, Any]
) -> NDArray[np.float32]:
    """Return what the display window shows: black where the data window does not reach.

    Of a crop, nothing else is known: it is as it is.
    """
    if CROP in header:
        return image
    (left, top), (right, bottom) = header["displayWindow"]
    (x, y), (last_x, last_y) = header["dataWindow"]
    if (x, y, last_x, last_y) == (left, top, right, bottom):
        return image
    shown = np.zeros((bottom - top + 1, right - left + 1, 3), np.float32)
    here = np.s_[max(top, y) - top : min(bottom, last_y) + 1 - top]
    across = np.s_[max(left, x) - left : min(right, last_x) + 1 - left]
    there = np.s_[max(top, y) - y : min(bottom, last_y) + 1 - y]
    along = np.s_[max(left, x) - x : min(right, last_x) + 1 - x]
    shown[here, across] = image[there, along]
    return shown
