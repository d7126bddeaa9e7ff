"""Cryptomattes: which things a pixel shows, and how much of each.

A film has a matte as pairs of channels: the id of a thing, whose bits are a hash of its name, and
the samples that have met it. Sums of ids would be no ids, so the pairs of two films are joined by
their ids, whatever their ranks. An image has the share of the samples in the place of their number,
and the pairs in falling order of it. A pixel that has met more things than there are pairs keeps
those that have most.

Source: Friedman and Jones, Fully automatic ID mattes with support for motion blur and transparency,
SIGGRAPH 2015 Posters, DOI 10.1145/2787626.2787629.
"""

import re
from collections import defaultdict
from collections.abc import Mapping
from functools import lru_cache
from itertools import product
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plateau.farm.images.crops import CROP, check_crop

_CHANNEL: Final = re.compile(r"(.*Crypto(?:Object|Material|Asset))(\d\d)\.([rgba])")
#: Of what an EXR file says about its mattes, by the specification of Cryptomatte.
_ATTRIBUTE: Final = re.compile(r"cryptomatte/[0-9a-f]{1,7}/(?:name|hash|conversion|manifest)")
_MOST_SAID: Final = 2**23  #: characters of all attributes together


def letter_of(channel: str) -> str:
    """Return which channel of a matte's layer it is: r or b, an id, g or a, samples; else "".

    Examples
    --------
    >>> letter_of("ViewLayer.CryptoObject00.b"), letter_of("ViewLayer.Depth.Z")
    ('b', '')
    """
    matte = _CHANNEL.fullmatch(channel)
    return matte[3] if matte else ""


@lru_cache
def mattes(names: tuple[str, ...]) -> tuple[tuple[int, ...], ...]:
    """Return the places of each matte's channels: of an id, of its samples, and so on, by rank.

    Examples
    --------
    >>> mattes(("R", "CryptoObject00.a", "CryptoObject00.b", "CryptoObject00.g",
    ...         "CryptoObject00.r"))
    ((4, 3, 2, 1),)
    """
    found = defaultdict[str, dict[tuple[int, str], int]](dict)
    for place, name in enumerate(names):
        if (matte := _CHANNEL.fullmatch(name)) is not None:
            found[matte[1]][int(matte[2]), matte[3]] = place
    orders = [tuple(product(range(len(places) // 4), "rgba")) for places in found.values()]
    return tuple(
        tuple(places[one] for one in order)
        for order, places in zip(orders, found.values(), strict=True)
        if set(order) == set(places)  # a part of a matte is none
    )


def joined(total: NDArray[np.float64], film: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the pairs of a sum of films once the next film is added.

    Parameters
    ----------
    total : ndarray, shape (..., 2 pairs), float64
        Those of the sum so far: an id, its samples, the next id, and so on.
    film : ndarray, shape (..., 2 pairs), float32
        Those of the film.
    """
    found: NDArray[np.float64] = total.copy()
    alike = np.all(found[..., ::2] == film[..., ::2], axis=-1)
    found[..., 1::2] += np.where(alike[..., np.newaxis], film[..., 1::2], 0)
    others = ~alike  # few, at the edges of things
    pairs, more = found[others], film[others]
    for rank in range(0, more.shape[-1], 2):
        _join(pairs, more[:, rank], more[:, rank + 1])
    found[others] = pairs
    return found


def _join(
    pairs: NDArray[np.float64], ids: NDArray[np.float32], samples: NDArray[np.float32]
) -> None:
    """Add one more pair to each row of pairs, in place."""
    sums = pairs[:, 1::2]
    same = (pairs[:, ::2] == ids[:, np.newaxis]) & (sums > 0)
    is_known = same.any(axis=1)
    place = np.where(is_known, same.argmax(axis=1), sums.argmin(axis=1))
    rows = np.arange(len(pairs))
    least = sums[rows, place]
    takes = (samples > 0) & (is_known | (least < samples))
    rows, place = rows[takes], 2 * place[takes]
    pairs[rows, place] = ids[takes]
    pairs[rows, place + 1] = samples[takes] + np.where(is_known[takes], least[takes], 0)


def ranked(pairs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the pairs of each pixel, (..., 2 pairs), with those first that have most samples."""
    order = np.argsort(-pairs[..., 1::2], axis=-1, kind="stable")
    found = np.empty_like(pairs)
    for first in (0, 1):
        found[..., first::2] = np.take_along_axis(pairs[..., first::2], order, axis=-1)
    return found


def check_attributes(attributes: Mapping[str, Any]) -> None:
    """Raise ValueError for attributes of a header that are of neither a matte nor a crop."""
    for name, value in attributes.items():
        if name == CROP:
            check_crop(value)
        elif not (isinstance(value, str) and _ATTRIBUTE.fullmatch(name)):
            raise ValueError(f"{name[:100]!r} is no attribute of a Cryptomatte")
    if sum(map(len, attributes.values())) > _MOST_SAID:
        raise ValueError("the names of a Cryptomatte's things are too long")


def attributes_of(header: Mapping[str, Any]) -> dict[str, str]:
    """Return the attributes of an EXR file's header that are about its mattes or its crop."""
    return {
        name: value for name, value in header.items() if name == CROP or _ATTRIBUTE.fullmatch(name)
    }
