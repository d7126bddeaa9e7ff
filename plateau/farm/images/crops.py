"""The place of an image in its film, where it is a crop of it: part of what its header says."""

import re
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

#: The attribute of an EXR file that has the crop's offset and the film's size.
CROP: Final = "plateau:crop"
_VALUE: Final = re.compile(r"\d{1,6} \d{1,6} \d{1,6} \d{1,6}")


def crop_header(offset: tuple[int, int], film: tuple[int, int]) -> dict[str, str]:
    """Return what the header of a crop says, by its offset in a film of this size, in pixels."""
    return {CROP: f"{offset[0]} {offset[1]} {film[0]} {film[1]}"}


def check_crop(value: str) -> None:
    """Raise ValueError unless it is what `crop_header` says."""
    if not _VALUE.fullmatch(value):
        raise ValueError(f"{value[:100]!r} is no place in a film")


def windows(header: Mapping[str, Any], width: int, height: int) -> dict[str, Any]:
    """Return the data window and the display window of an EXR file with this image.

    Examples
    --------
    >>> windows(crop_header((3, 4), (32, 24)), 5, 3)["dataWindow"][1].tolist()
    [7, 6]
    """
    if CROP not in header:
        return {}
    x, y, film_width, film_height = map(int, header[CROP].split())
    return {
        "dataWindow": _window(x, y, width, height),
        "displayWindow": _window(0, 0, film_width, film_height),
    }


def _window(x: int, y: int, width: int, height: int) -> tuple[Any, Any]:
    return np.array([x, y], np.int32), np.array([x + width - 1, y + height - 1], np.int32)
