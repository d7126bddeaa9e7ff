"""The named channels of a film, and how films are added.

A film is (height, width, channels). Its first channels are R, G, B and W: sums of radiance, each
sample weighted by the reconstruction filter, and the sums of the weights. A film with alpha has A
next, weighted alike. AOVs follow. They are weighted sums too, but for ids (numbers of objects and
primitives): there a pixel has the value of its first sample, and a sum of films that of its first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_COLOUR: Final = ("R", "G", "B")
_WEIGHT: Final = 3  #: where W is
_ALPHA: Final = 4  #: where A is, in a film that has it

#: Linear R, G and B.
Colour = tuple[float, float, float]
BLACK: Final[Colour] = (0.0, 0.0, 0.0)

#: A film has at most so many channels, whose names have at most so many characters.
MOST_CHANNELS: Final = 64
_LONGEST_NAME: Final = 64
#: And so many values, of all pixels and channels together: 1 GiB in float32.
MOST_VALUES: Final = 2**28


@dataclass(frozen=True)
class Channels:
    """The channels of a film, in the order of their values.

    Parameters
    ----------
    names : sequence of str
        R, G, B, W; then A, where the film has alpha; then AOVs.
    ids : sequence of str
        Those AOVs that must not be averaged.

    Raises
    ------
    ValueError
        These are no channels of a film; the message says why.
    """

    names: Sequence[str] = (*_COLOUR, "W")
    ids: Sequence[str] = ()

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

    def check_size(self, width: int, height: int) -> None:
        """Raise ValueError where these are no width and height, or the film has too many values."""
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
        """Whether there is A."""
        return "A" in self.names

    @property
    def aovs(self) -> tuple[str, ...]:
        """The channels beside colour, weight and alpha."""
        return tuple(self.names[self.judged :])

    @property
    def judged(self) -> int:
        """How many channels, from the first on, say what is seen: R, G, B, W and, if any, A."""
        return _ALPHA + self.has_alpha

    def seen(self) -> Channels:
        """Return those that say what is seen."""
        return Channels(self.names[: self.judged])

    def add(
        self, total: NDArray[np.float64] | None, film: NDArray[np.float32]
    ) -> NDArray[np.float64]:
        """Return a sum of films with the next one added, in place; ids stay those of the first.

        Parameters
        ----------
        total : ndarray, shape (height, width, channels), float64, or None
            The sum so far; None where this film is the first.
        film : ndarray, shape (height, width, channels), float32
            A film, or sum of films, of these channels.
        """
        with np.errstate(invalid="ignore", over="ignore"):  # a scene may have infinite pixels
            if total is None:
                return np.add(0.0, film, dtype=np.float64)
            if not self.ids:
                return np.add(total, film, out=total)
            planes = [self.names.index(name) for name in self.ids]
            first = total[..., planes]
            np.add(total, film, out=total)
            total[..., planes] = first
            return total

    def normalised(self, total: NDArray[np.float64]) -> dict[str, NDArray[np.float32]]:
        """Return the image that a sum of films is: (height, width) float32 by channel, without W.

        A pixel that no sample has reached is 0 everywhere. Ids are as they are.
        """
        return {
            name: total[..., plane].astype(np.float32)
            if name in self.ids
            else _quotient(total[..., plane], total[..., _WEIGHT])
            for plane, name in enumerate(self.names)
            if plane != _WEIGHT
        }

    def seen_in(
        self, total: NDArray[np.float64], background: Colour = BLACK
    ) -> NDArray[np.float32]:
        """Return what is seen of a sum of films: (height, width, 3) float32 linear radiance.

        Parameters
        ----------
        total : ndarray, shape (height, width, at least `judged`), float64
            The sum.
        background : tuple of float
            Linear R, G and B, seen where the image has alpha below 1. Where alpha is not finite,
            the pixel counts as opaque.
        """
        image = np.empty((*total.shape[:2], 3), np.float32)
        weights = total[..., _WEIGHT]
        for plane in range(3):
            image[..., plane] = _quotient(total[..., plane], weights)
        if self.has_alpha and background != BLACK:
            alpha = _quotient(total[..., _ALPHA], weights)
            uncovered = np.where(np.isfinite(alpha), 1 - alpha, 0)
            with np.errstate(invalid="ignore", over="ignore"):
                image += uncovered[..., None] * np.array(background, np.float32)
        return image


def _quotient(sums: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float32]:
    # Channel by channel, for rows of one of them are a quarter of the time of rows of several.
    reached = weights != 0
    where: Any = True if reached.all() else reached
    values = np.zeros(weights.shape, np.float32)
    with np.errstate(invalid="ignore", over="ignore"):
        np.divide(sums, weights, out=values, where=where, casting="same_kind")
    return values
