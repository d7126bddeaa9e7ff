"""Tells renders with samples of their own from copies of one, such as two of the same seed.

Where samples are independent, two renders differ at a pixel by about as much as its noise differs
from that of its neighbours. Of two renders with one seed the last bits differ, or what a format
rounds. Pixels without any difference to their neighbours tell nothing, and where there are hardly
any others no noise is left to be judged.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from plateau.errors import CommandFailed
from plateau.farm.images.exr import Pixels

#: The most pixels of an image that are compared, and the fewest.
_MOST: Final = 4096
_LEAST: Final = 16
#: A pixel differs from its neighbours where it does so by this share of its value.
_DETAIL: Final = 1e-4
#: Two pixels are one where they differ by at most this share of what each differs from its
#: neighbours, and of its value.
_OF_DETAIL: Final = 0.01
_OF_VALUE: Final = 1e-3
#: More of the pixels are one in no two renders of their own.
_MOST_ALIKE: Final = 0.5


class NotIndependent(CommandFailed):
    """Two images that are taken as independent have the same samples."""


class Independence:
    """The images of a series so far, each with samples that no other has."""

    def __init__(self) -> None:
        self._jobs: dict[str, str] = {}  # the image's name by its job
        self._names: list[str] = []
        self._values: list[NDArray[np.float64]] = []

    def add(self, name: str, image: Pixels, job: str | None) -> None:
        """Take in another image of the same size, and the job of Plateau's that made it, if any.

        Raises
        ------
        NotIndependent
            It has samples of an earlier one; the message names both.
        """
        if job is not None and (other := self._jobs.setdefault(job, name)) != name:
            raise NotIndependent(
                f"{other} and {name} are both of job {job}, and one has samples of the other: give "
                "images of jobs with different seeds"
            )
        values, detail = _sampled(image)
        telling = detail > _DETAIL * np.abs(values)
        comparable = self._values and len(self._values[0]) == len(values)
        if comparable and np.count_nonzero(telling) >= _LEAST:
            others = np.stack(self._values)[:, telling]
            alike = _share_alike(others, values[telling], detail[telling])
            if alike.max() > _MOST_ALIKE:
                raise NotIndependent(
                    f"{self._names[int(alike.argmax())]} and {name} have the same noise, as "
                    "renders with one seed have: render each with a seed of its own"
                )
        self._names.append(name)
        self._values.append(values)


def _sampled(image: Pixels) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return pixels of an image, and what each differs from those beside it; NaN if not finite."""
    with np.errstate(invalid="ignore", over="ignore"):
        grey = np.where(np.isfinite(image), image, np.nan).astype(np.float64).mean(axis=-1)
        detail = np.abs(grey[:, 1:-1] - (grey[:, :-2] + grey[:, 2:]) / 2).ravel()
    values = grey[:, 1:-1].ravel()
    chosen = np.unique(np.linspace(0, len(values) - 1, min(_MOST, len(values))).astype(int))
    return values[chosen], detail[chosen]


def _share_alike(
    others: NDArray[np.float64], values: NDArray[np.float64], detail: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return of each other image the share of the detailed pixels that are one with these."""
    most = np.minimum(_OF_DETAIL * detail, _OF_VALUE * np.abs(values))
    share: NDArray[np.float64] = (np.abs(others - values) <= most).mean(axis=1)
    return share
