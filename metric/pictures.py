"""Pictures of a judgement for viewing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.metric.display import Mask
    from plateau.metric.non_finite import NonFinite

#: Codes and colours of the marks on an image in dim grey: visible, NaN and infinite pixels.
_VISIBLE, _NAN, _INFINITE = 255, 254, 253
_COLOURS = {_VISIBLE: (255, 140, 0), _NAN: (255, 0, 255), _INFINITE: (0, 200, 255)}
#: The colour of each code of a map, (256, 3) uint8.
MAP_PALETTE = np.repeat(np.arange(256, dtype=np.uint8)[:, np.newaxis], 3, axis=1)
for _code, _colour in _COLOURS.items():
    MAP_PALETTE[_code] = _colour


def difference_map(picture: NDArray[np.uint8], visible: Mask) -> NDArray[np.uint8]:
    """Return the map of visible pixels over a picture, (H, W) uint8 indices of `MAP_PALETTE`.

    Parameters
    ----------
    picture
        (H, W, 3) uint8, from `metric.encode_srgb`.
    visible
        The map, (H, W) bool.

    Examples
    --------
    >>> visible = np.array([[True, False]])
    >>> codes = difference_map(np.full((1, 2, 3), 255, np.uint8), visible)
    >>> MAP_PALETTE[codes].tolist()
    [[[255, 140, 0], [85, 85, 85]]]
    """
    codes = _dim_grey(picture)
    codes[visible] = _VISIBLE
    return codes


def non_finite_map(picture: NDArray[np.uint8], found: NonFinite) -> NDArray[np.uint8]:
    """Return the map of pixels that are NaN (magenta) or infinite (blue) over a picture.

    Parameters and codes are as for `difference_map`.

    Examples
    --------
    >>> from plateau.metric.non_finite import non_finite_pixels
    >>> image = np.array([[[np.nan] * 3, [np.inf] * 3, [0] * 3]], np.float32)
    >>> codes = non_finite_map(np.zeros((1, 3, 3), np.uint8), non_finite_pixels(image))
    >>> MAP_PALETTE[codes].tolist()
    [[[255, 0, 255], [0, 200, 255], [0, 0, 0]]]
    """
    codes = _dim_grey(picture)
    codes[found.nan] = _NAN
    codes[found.infinite] = _INFINITE
    return codes


def _dim_grey(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a third of each pixel's mean, (H, W) uint8: 85 at most."""
    red, green, blue = np.moveaxis(picture.astype(np.uint16), -1, 0)
    codes: NDArray[Any] = (red + green + blue) // 9
    return codes.astype(np.uint8)
