"""The merged image of a job: partials added up, and what a restart needs to go on."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plateau.farm.images.exr import Pixels


@dataclass(kw_only=True)
class Merge:
    """The sum of a contiguous prefix of slices, added in index order in float64.

    So the image does not depend on which workers rendered it, nor in which order they finished.

    Notes
    -----
    Two sums are kept: of all slices and of the even-indexed ones; the odd-indexed ones are the
    difference. They are (height, width, 4) float64: weighted R, G, B radiance and the weights.
    """

    slice_spp: int
    slices: int = 0  #: how many are in the sums: the prefix 0 … slices − 1
    _total: NDArray[np.float64] | None = field(default=None, repr=False)
    _even: NDArray[np.float64] | None = field(default=None, repr=False)

    @property
    def spp(self) -> int:
        """Samples per pixel in the merged image."""
        return self.slices * self.slice_spp

    def add(self, film: Pixels) -> None:
        """Add the next slice's film, (height, width, 4) float32 before normalisation.

        Raises
        ------
        ValueError
            Its size is not that of the slices before.
        """
        if self._total is None or self._even is None:
            self._total = np.zeros(film.shape, np.float64)
            self._even = np.zeros(film.shape, np.float64)
        if film.shape != self._total.shape:
            raise ValueError(
                f"slice {self.slices} is {film.shape[1]}×{film.shape[0]} pixels, those before it "
                f"{self._total.shape[1]}×{self._total.shape[0]}"
            )
        with _infinities():
            self._total += film
            if self.slices % 2 == 0:
                self._even += film
        self.slices += 1

    def image(self) -> Pixels:
        """The merged image: (height, width, 3) float32 linear radiance."""
        assert self._total is not None
        return normalised(self._total)

    def halves(self) -> tuple[tuple[Pixels, int], tuple[Pixels, int]] | None:
        """The images of the even- and of the odd-indexed slices, each with its spp."""
        if self.slices < 2 or self._total is None or self._even is None:
            return None
        odd = self.slices // 2
        even = self.slices - odd
        with _infinities():
            rest = self._total - self._even
        return (
            (normalised(self._even), even * self.slice_spp),
            (normalised(rest), odd * self.slice_spp),
        )

    def arrays(self) -> dict[str, NDArray[Any]]:
        """What a checkpoint keeps of the sums."""
        assert self._total is not None
        assert self._even is not None
        return {"total": self._total, "even": self._even}

    @classmethod
    def from_arrays(cls, slice_spp: int, slices: int, arrays: dict[str, NDArray[Any]]) -> "Merge":
        """The sums of a checkpoint."""
        return cls(slice_spp=slice_spp, slices=slices, _total=arrays["total"], _even=arrays["even"])


def normalised(film: NDArray[np.float64]) -> Pixels:
    """The (height, width, 3) float32 image of a (height, width, 4) float64 sum of films."""
    weights = film[..., 3]
    reached = weights != 0  # a pixel that no sample has reached is black
    where = True if reached.all() else reached
    image = np.zeros((*weights.shape, 3), np.float32)
    # Channel by channel, for rows of one of them are a quarter of the time of rows of three.
    with _infinities():
        for channel in range(3):
            np.divide(
                film[..., channel],
                weights,
                out=image[..., channel],
                where=where,
                casting="same_kind",
            )
    return image


def _infinities() -> np.errstate:
    """While sums are worked with: a scene may have infinite pixels, of which numpy would warn."""
    return np.errstate(invalid="ignore", over="ignore")
