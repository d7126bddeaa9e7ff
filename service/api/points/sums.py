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

#: So many bytes of sums are remembered; the newest one in any case.
_REMEMBERED: Final = 128 << 20

Sum = NDArray[np.float64]


class PointSums:
    """Merges slices again, as the monitor did; for one thread.

    Parameters
    ----------
    store
        Where the slices are.
    """

    def __init__(self, store: Blobs) -> None:
        self._blobs = store
        # By job and number of slices, the longest unused first.
        self._sums: OrderedDict[tuple[str, int], Sum] = OrderedDict()

    def image(
        self, job_id: str, slices: Sequence[KeptSlice], *, is_given_up: Callable[[], bool]
    ) -> Pixels | None:
        """The merged image, (height, width, 3) float32 linear radiance; None where given up.

        Parameters
        ----------
        job_id
            Whose slices they are.
        slices
            From the first one on, without a gap; one at least.
        is_given_up
            Asked before each slice: whether nobody waits for the image any more.

        Raises
        ------
        SliceLost
            A slice cannot be used.
        """
        total = self._merged(job_id, slices, is_given_up)
        return None if total is None else normalised(total)

    def _merged(
        self, job_id: str, slices: Sequence[KeptSlice], is_given_up: Callable[[], bool]
    ) -> Sum | None:
        """The sum of the slices, added in order in float64 as the monitor does."""
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
        return total if done == len(slices) else None

    def _remembered(self, job_id: str, slices: int) -> tuple[int, Sum | None]:
        """How many slices are in the longest sum that helps, and a copy of it."""
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
