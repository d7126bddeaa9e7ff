"""The sums of a job's kept slices up to points of its curve; some are remembered."""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plateau.farm.blobs.store import Blobs
from plateau.farm.images.channels import BLACK, Channels, Colour
from plateau.farm.images.exr import Partial, Pixels
from plateau.farm.images.view_transform import ViewTransform
from plateau.farm.model.errors import CorruptPartial
from plateau.picture.films import checked_partial
from plateau.picture.merge import Merge
from plateau.service.api.points import KeptSlice, SliceLost

#: The most bytes of sums that are kept; the newest sum always is.
_REMEMBERED: Final = 128 << 20


@dataclass(frozen=True)
class Sum:
    """The sum of the slices' visible channels: R, G, B, W and A, if any."""

    channels: Channels
    total: NDArray[np.float64]

    def copy(self) -> "Sum":
        """A copy that can grow."""
        return Sum(self.channels, self.total.copy())


class PointSums:
    """Merges slices from the store as the monitor did; for one thread."""

    def __init__(self, store: Blobs) -> None:
        self._blobs = store
        # By job and number of slices, the least recently used first.
        self._sums: OrderedDict[tuple[str, int], Sum] = OrderedDict()

    def image(
        self,
        job_id: str,
        slices: Sequence[KeptSlice],
        *,
        is_given_up: Callable[[], bool],
        background: Colour = BLACK,
        zone_size: int | None = None,
    ) -> Pixels | None:
        """The merged image of a job's first slices; None if given up, which is asked before each.

        It is (height, width, 3) float32 linear radiance, over `background` where it has alpha.
        Slices are added in order and in float64, as the monitor does. Sums of zones, which have
        `zone_size` pixels to a side, are not remembered. Raises `SliceLost` if a slice is gone or
        damaged.
        """
        if zone_size is not None:
            merge = Merge(slice_spp=1, zone_size=zone_size, background=background)
            for index, kept in enumerate(slices):
                if is_given_up():
                    return None
                merge.add_partial(self._partial(index, kept))
            return merge.image()
        done, found = self._remembered(job_id, len(slices))
        for index in range(done, len(slices)):
            if is_given_up():
                break
            partial = self._partial(index, slices[index])
            seen = partial.channels.seen()
            film = partial.pixels[..., : partial.channels.judged]
            if found is None:
                found = Sum(seen, seen.add(None, film))
            elif (film.shape, seen) != (found.total.shape, found.channels):
                raise SliceLost(f"slice {index} has another size than those before it, or channels")
            else:
                seen.add(found.total, film)
            done = index + 1
        if found is None:
            return None
        self._remember((job_id, done), found)
        return found.channels.seen_in(found.total, background) if done == len(slices) else None

    def transform(self, slices: Sequence[KeptSlice]) -> ViewTransform | None:
        """The view transform of the job's scene, if it has one; raises `SliceLost`."""
        return self._partial(0, slices[0]).transform

    def _remembered(self, job_id: str, slices: int) -> tuple[int, Sum | None]:
        """The number of slices in the longest usable sum, and that sum: a copy if it will grow."""
        done = max((n for job, n in self._sums if job == job_id and n <= slices), default=0)
        if not done:
            return 0, None
        self._sums.move_to_end((job_id, done))
        found = self._sums[job_id, done]
        return done, found if done == slices else found.copy()

    def _remember(self, name: tuple[str, int], merged: Sum) -> None:
        self._sums[name] = merged
        self._sums.move_to_end(name)
        while (
            len(self._sums) > 1
            and sum(one.total.nbytes for one in self._sums.values()) > _REMEMBERED
        ):
            self._sums.popitem(last=False)

    def _partial(self, index: int, kept: KeptSlice) -> Partial:
        try:
            return checked_partial(self._blobs, kept.blob, kept.sha256)
        except FileNotFoundError as error:
            raise SliceLost(f"slice {index} is gone") from error
        except CorruptPartial as error:
            raise SliceLost(f"slice {index} is damaged: {error}") from error
