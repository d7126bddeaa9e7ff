"""The sums of a job's kept slices up to points of its curve; some are remembered."""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plateau.farm.blobs.store import Blobs
from plateau.farm.images.exr import Pixels
from plateau.farm.model.errors import CorruptPartial
from plateau.service.api.points import KeptSlice, SliceLost
from plateau.service.judging.films import checked_film
from plateau.service.judging.merge import normalised

#: The most bytes of sums that are kept; the newest sum always is.
_REMEMBERED: Final = 128 << 20

Sum = NDArray[np.float64]


class PointSums:
    """Merges slices from the store as the monitor did; for one thread."""

    def __init__(self, store: Blobs) -> None:
        self._blobs = store
        # By job and number of slices, the least recently used first.
        self._sums: OrderedDict[tuple[str, int], Sum] = OrderedDict()

    def image(
        self, job_id: str, slices: Sequence[KeptSlice], *, is_given_up: Callable[[], bool]
    ) -> Pixels | None:
        """The merged image of a job's first slices; None if given up, which is asked before each.

        It is (height, width, 3) float32 linear radiance. Slices are added in order and in float64,
        as the monitor does. Raises `SliceLost` if a slice is gone or damaged.
        """
        done, total = self._remembered(job_id, len(slices))
        for index in range(done, len(slices)):
            if is_given_up():
                break
            film = self._film(index, slices[index])
            if total is None:
                total = np.zeros(film.shape, np.float64)
            if film.shape != total.shape:
                raise SliceLost(f"slice {index} has another size than those before it")
            total += film
            done = index + 1
        if total is not None:
            self._remember((job_id, done), total)
        return normalised(total) if total is not None and done == len(slices) else None

    def _remembered(self, job_id: str, slices: int) -> tuple[int, Sum | None]:
        """The number of slices in the longest usable sum, and that sum: a copy if it will grow."""
        done = max((n for job, n in self._sums if job == job_id and n <= slices), default=0)
        if not done:
            return 0, None
        self._sums.move_to_end((job_id, done))
        found = self._sums[job_id, done]
        return done, found if done == slices else found.copy()

    def _remember(self, name: tuple[str, int], total: Sum) -> None:
        self._sums[name] = total
        self._sums.move_to_end(name)
        while len(self._sums) > 1 and sum(one.nbytes for one in self._sums.values()) > _REMEMBERED:
            self._sums.popitem(last=False)

    def _film(self, index: int, kept: KeptSlice) -> Pixels:
        try:
            return checked_film(self._blobs, kept.blob, kept.sha256)
        except FileNotFoundError as error:
            raise SliceLost(f"slice {index} is gone") from error
        except CorruptPartial as error:
            raise SliceLost(f"slice {index} is damaged: {error}") from error
