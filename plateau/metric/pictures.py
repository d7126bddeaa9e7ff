"""Pictures of a judgement for viewing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.metric.display import Mask, Plane
    from plateau.metric.non_finite import NonFinite

#: Codes and colours of the marks on an image in dim grey: visible, NaN, infinite, perhaps visible.
_VISIBLE, _NAN, _INFINITE, _PERHAPS = 255, 254, 253, 252
_COLOURS = {
    _VISIBLE: (255, 140, 0),
    _NAN: (255, 0, 255),
    _INFINITE: (0, 200, 255),
    _PERHAPS: (170, 70, 0),
}
#: The colour of each code of a map, (256, 3) uint8.
MAP_PALETTE = np.repeat(np.arange(256, dtype=np.uint8)[:, np.newaxis], 3, axis=1)
for _code, _colour in _COLOURS.items():
    MAP_PALETTE[_code] = _colour

#: Colours from few samples to many, at equal distances: those of matplotlib's viridis. Each is
#: lighter than the one before it.
_SCALE = (0x440154, 0x472D7B, 0x3B528B, 0x2C728E, 0x21918C, 0x27AD81, 0x5CC863, 0xAADC32, 0xFDE725)
#: The colour of each code of a map of samples, (256, 3) uint8.
SAMPLES_PALETTE = np.column_stack(
    [
        np.rint(
            np.interp(
                np.linspace(0, len(_SCALE) - 1, 256),
                np.arange(len(_SCALE)),
                [colour >> shift & 0xFF for colour in _SCALE],
            )
        )
        for shift in (16, 8, 0)
    ]
).astype(np.uint8)


#: Three JOD are lost where the error is such that hardly anybody prefers the image.
_MOST_HEAT = 0.3


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


def noise_map(picture: NDArray[np.uint8], visible: Plane) -> NDArray[np.uint8]:
    """Return the map of the noise that is left to see over a picture.

    Parameters and codes are as for `difference_map`, but of `visible`: that of an `Estimate`,
    (H, W) of 0, ½ or 1. A pixel at ½ is marked in a darker orange.

    Examples
    --------
    >>> visible = np.array([[1.0, 0.5, 0.0]], np.float32)
    >>> codes = noise_map(np.zeros((1, 3, 3), np.uint8), visible)
    >>> MAP_PALETTE[codes].tolist()
    [[[255, 140, 0], [170, 70, 0], [0, 0, 0]]]
    """
    codes = difference_map(picture, visible > 0)
    codes[visible == np.float32(0.5)] = _PERHAPS
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


def samples_map(spp: NDArray[Any]) -> NDArray[np.uint8]:
    """Return the map of samples per pixel, as indices of `SAMPLES_PALETTE`, in the shape of `spp`.

    The scale is logarithmic, from the fewest samples to the most: equal steps of colour are equal
    ratios. Where all are equal, all have the first colour.

    Parameters
    ----------
    spp
        Samples per pixel, of any shape and real dtype, 1 or more.

    Examples
    --------
    >>> samples_map(np.array([[50, 100], [200, 200]])).tolist()
    [[0, 128], [255, 255]]
    """
    above = np.log(spp.astype(np.float64) / spp.min())
    codes: NDArray[Any] = np.rint(255 * above / (above.max() or 1))
    return codes.astype(np.uint8)


def heat_map(heat: Plane, most: float = _MOST_HEAT) -> NDArray[np.uint8]:
    """Return where a person would see an error, as indices of `SAMPLES_PALETTE`, (H, W).

    Parameters
    ----------
    heat
        The map of `plateau.metric.cvvdp.Quality`, (H, W) of 0 or more: what is lost, over 10 JOD.
    most
        The value from which on all pixels have the last colour; by default 3 JOD are lost there.

    Examples
    --------
    >>> heat_map(np.array([[0, 0.15, 0.3, 1]], np.float32)).tolist()
    [[0, 128, 255, 255]]
    """
    codes: NDArray[Any] = np.rint(255 * np.minimum(heat / np.float32(most), 1))
    return codes.astype(np.uint8)


def _dim_grey(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a third of each pixel's mean, (H, W) uint8: 85 at most."""
    red, green, blue = np.moveaxis(picture.astype(np.uint16), -1, 0)
    codes: NDArray[Any] = (red + green + blue) // 9
    return codes.astype(np.uint8)
