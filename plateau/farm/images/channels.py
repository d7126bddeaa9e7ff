"""The named channels of a film, and how films are added.

A film is (height, width, channels). Its first channels are R, G, B and W: the sums of radiance, in
which the reconstruction filter weights each sample, and the sums of the weights. A film with alpha
has A next, and AOVs follow; they are weighted sums as well. Ids (numbers of shapes and primitives)
are not: a pixel has the value of its first sample, and a sum of films has the values of its first.
Nor are Cryptomattes, see `plateau.farm.images.mattes`.

Some renderers divide direct and indirect light by the colour of the surface. A mean of quotients is
not the quotient of the means, so a film has the light and the colour, and an image the quotient.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plateau.farm.images.mattes import joined, mattes, ranked

_COLOUR: Final = ("R", "G", "B")
_WEIGHT: Final = 3  #: where W is
_ALPHA: Final = 4  #: where A is, in a film that has it

#: Linear R, G and B.
Colour = tuple[float, float, float]
BLACK: Final[Colour] = (0.0, 0.0, 0.0)

#: The most channels of a film, and the most characters of a channel's name.
MOST_CHANNELS: Final = 128
_LONGEST_NAME: Final = 160  # a layer and a pass may have 63 each
#: The most values of a film, in all pixels and channels together: 1 GiB in float32.
MOST_VALUES: Final = 2**28


@dataclass(frozen=True)
class Channels:
    """The channels of a film, in the order of their values.

    Parameters
    ----------
    names : sequence of str
        R, G, B, W; then A, if the film has alpha; then AOVs.
    ids : sequence of str
        The AOVs that must not be averaged.
    quotients : sequence of pairs of str
        AOVs of light, each with that of the colour by which an image divides it.

    Raises
    ------
    ValueError
        No film has such channels; the message says why.
    """

    names: Sequence[str] = (*_COLOUR, "W")
    ids: Sequence[str] = ()
    quotients: Sequence[tuple[str, str]] = ()

    def __post_init__(self) -> None:
        for field in ("names", "ids"):
            given = getattr(self, field)
            if not isinstance(given, (list, tuple)) or not all(isinstance(n, str) for n in given):
                raise ValueError(f"the channels' {field} are no list of names")
            object.__setattr__(self, field, tuple(given))
        if self.names[:_ALPHA] != (*_COLOUR, "W"):
            raise ValueError("a film's channels begin with R, G, B and W")
        if len(self.names) > MOST_CHANNELS:
            raise ValueError(
                f"a film has at most {MOST_CHANNELS} channels, and this one {len(self.names)}"
            )
        for name in self.names:
            if not (0 < len(name) <= _LONGEST_NAME and name.isascii() and name.isprintable()):
                raise ValueError(
                    f"{name[:_LONGEST_NAME]!r} is no name of a channel: it has 1 to "
                    f"{_LONGEST_NAME} printable ASCII characters"
                )
        if len(set(self.names)) < len(self.names):
            raise ValueError(f"two channels have one name: {', '.join(self.names)}")
        if "A" in self.names[_ALPHA + 1 :]:
            raise ValueError("the channel A follows W")
        if not set(self.ids) <= set(self.aovs):
            raise ValueError("ids are AOVs, and one of these is no channel of the film")
        try:
            pairs = tuple((light, colour) for light, colour in self.quotients)
            known = all(set(pair) <= set(self.aovs) for pair in pairs)
        except (TypeError, ValueError):
            known = False
        if not known:
            raise ValueError("quotients are pairs of AOVs, and one of these is none")
        object.__setattr__(self, "quotients", pairs)

    def check_size(self, width: int, height: int) -> None:
        """Raise ValueError for a size in pixels that a film with these channels cannot have."""
        if not all(type(side) is int and side > 0 for side in (width, height)):
            raise ValueError(f"a film of {width!r}×{height!r} pixels has no size")
        values = width * height * len(self.names)
        if values > MOST_VALUES:
            raise ValueError(
                f"{width}×{height} pixels of {len(self.names)} channels are {values:,} values, and "
                f"a film has at most {MOST_VALUES:,}: ask for fewer AOVs, or a smaller film"
            )

    @property
    def has_alpha(self) -> bool:
        """Whether A is one of them."""
        return "A" in self.names

    @property
    def aovs(self) -> tuple[str, ...]:
        """The channels besides colour, weight and alpha."""
        return tuple(self.names[self.judged :])

    @property
    def exact(self) -> tuple[str, ...]:
        """The channels whose values are no amounts, so that all their bits count."""
        of_mattes = (self.names[plane] for matte in self._mattes for plane in matte)
        return (*self.ids, *of_mattes)

    @property
    def _mattes(self) -> tuple[tuple[int, ...], ...]:
        return mattes(tuple(self.names))

    @property
    def judged(self) -> int:
        """The number of leading channels that are judged: R, G, B, W and, if the film has it, A."""
        return _ALPHA + self.has_alpha

    def seen(self) -> "Channels":
        """Return the channels that are judged."""
        return Channels(self.names[: self.judged])

    def add(
        self, total: NDArray[np.float64] | None, film: NDArray[np.float32]
    ) -> NDArray[np.float64]:
        """Return a sum of films with the next film added, in place; ids stay those of the first.

        Parameters
        ----------
        total : ndarray, shape (height, width, channels), float64, or None
            The sum so far; None for the first film.
        film : ndarray, shape (height, width, channels), float32
            A film, or a sum of films, of these channels.
        """
        with _infinities():
            if total is None:
                return np.add(0.0, film, dtype=np.float64)
            unsummed = self._unsummed(total, film, self)
            np.add(total, film, out=total)
        for planes, values in unsummed:
            total[..., planes] = values
        return total

    def add_part(
        self, total: NDArray[np.float64], film: NDArray[np.float32], part: "Channels"
    ) -> NDArray[np.float64]:
        """Return a sum with a film added that lacks some channels, and there has the sum's mean.

        Parameters
        ----------
        total : ndarray, shape (..., channels), float64
            The sum so far; it is changed in place.
        film : ndarray, shape (..., fewer channels), float32
            The film.
        part : Channels
            Those of the film, which are some of these.
        """
        if part == self:
            return self.add(total, film)
        unsummed = self._unsummed(total, film, part)
        weights = film[..., _WEIGHT].astype(np.float64)
        with _infinities():
            growth = np.zeros_like(weights)
            np.divide(weights, total[..., _WEIGHT], out=growth, where=total[..., _WEIGHT] != 0)
            growth += 1
            for ours, theirs in _runs(self.names, part.names):
                if theirs is None:
                    total[..., ours] *= growth[..., np.newaxis]
                else:
                    total[..., ours] += film[..., theirs]
        for planes, values in unsummed:
            total[..., planes] = values
        return total

    def _unsummed(
        self, total: NDArray[np.float64], film: NDArray[np.float32], part: "Channels"
    ) -> list[tuple[list[int], NDArray[np.float64]]]:
        """Return planes that are no sums, with their values once a film of some is added."""
        ids = [self.names.index(name) for name in self.ids]
        found = [(ids, total[..., ids])] if ids else []
        for matte in self._mattes:
            planes = list(matte)
            theirs = [part.names.index(self.names[plane]) for plane in planes]
            found.append((planes, joined(total[..., planes], film[..., theirs])))
        return found

    def normalised(self, total: NDArray[np.float64]) -> dict[str, NDArray[np.float32]]:
        """Return the image of a sum of films: (height, width) float32 by channel, without W.

        Sums are divided by W, and some light by the sums of its colour. They are 0 where that is 0,
        as where no sample has reached the pixel. Ids are not divided; a matte's pairs are ranked.
        """
        total, ids = self._ranked(total)
        reached = _reached(total)
        colours = dict(self.quotients)
        image = {}
        for plane, name in enumerate(self.names):
            if plane in ids:
                image[name] = total[..., plane].astype(np.float32)
            elif plane != _WEIGHT:
                image[name] = np.zeros(total.shape[:2], np.float32)
                if name in colours:
                    by = self.names.index(colours[name])
                    _divide(total, plane, total[..., by] != 0, image[name], by)
                else:
                    _divide(total, plane, reached, image[name])
        return image

    def _ranked(self, total: NDArray[np.float64]) -> tuple[NDArray[np.float64], set[int]]:
        """Return a sum with the pairs of its mattes ranked, and the planes of all ids."""
        ids = {self.names.index(name) for name in self.ids}
        if self._mattes:
            total = total.copy()
        for matte in self._mattes:
            planes = list(matte)
            total[..., planes] = ranked(total[..., planes])
            ids.update(planes[::2])
        return total, ids

    def seen_in(
        self, total: NDArray[np.float64], background: Colour = BLACK
    ) -> NDArray[np.float32]:
        """Return what is seen of a sum of films: (height, width, 3) float32 linear radiance.

        Parameters
        ----------
        total : ndarray, shape (height, width, at least `judged`), float64
            The sum.
        background : tuple of float
            Linear R, G and B behind an image with alpha. NaN or infinite alpha counts as opaque.
        """
        reached = _reached(total)
        image = np.zeros((*total.shape[:2], 3), np.float32)
        for plane in range(3):
            _divide(total, plane, reached, image[..., plane])
        if self.has_alpha and background != BLACK:
            alpha = np.zeros(total.shape[:2], np.float32)
            _divide(total, _ALPHA, reached, alpha)
            with _infinities():
                uncovered = np.where(np.isfinite(alpha), 1 - alpha, 0)
                image += uncovered[..., None] * np.array(background, np.float32)
        return image


def _runs(names: Sequence[str], part: Sequence[str]) -> list[tuple[slice, slice | None]]:
    """Return neighbours among the names, each run with its place in a part, or None if it has none.

    Examples
    --------
    >>> for run in _runs("abc", "ac"):
    ...     print(run)
    (slice(0, 1, None), slice(0, 1, None))
    (slice(1, 2, None), None)
    (slice(2, 3, None), slice(1, 2, None))
    """
    offsets = [part.index(name) - at if name in part else None for at, name in enumerate(names)]
    runs = []
    for offset, run in groupby(range(len(names)), key=offsets.__getitem__):
        first, *rest = run
        stop = first + 1 + len(rest)
        theirs = None if offset is None else slice(first + offset, stop + offset)
        runs.append((slice(first, stop), theirs))
    return runs


def _reached(total: NDArray[np.float64]) -> Any:
    """The pixels that have samples, as numpy's ``where`` takes them."""
    reached = total[..., _WEIGHT] != 0
    return True if reached.all() else reached


def _divide(
    total: NDArray[np.float64], plane: int, where: Any, out: NDArray[np.float32], by: int = _WEIGHT
) -> None:
    """Divide one channel of a sum by another: row by row of one takes a quarter of the time."""
    with _infinities():
        np.divide(total[..., plane], total[..., by], out=out, where=where, casting="same_kind")


def _infinities() -> np.errstate:
    """Keep numpy from warning of infinite values, which a scene may have."""
    return np.errstate(invalid="ignore", over="ignore")
