"""The previews of a job: a bounded number of pictures at points of its curve."""

import hashlib
from collections.abc import Callable
from itertools import pairwise
from typing import Final

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs

#: The most previews of a job, and the most bytes of them.
MOST: Final = 256
MOST_BYTES: Final = 64 << 20
#: The previews that a job may have however large they are.
LEAST: Final = 24


class Previews:
    """The pictures that a job keeps beside its newest, spread over its curve.

    A picture does not depend on which monitor merged it, so a monitor that takes over the job
    keeps the pictures that it finds.

    Parameters
    ----------
    store, job_id
        The blob store, and the job.
    note
        Called with the SHA-256 of a blob before it is stored, and with None once it is deleted.
    """

    def __init__(
        self, store: Blobs, job_id: str, note: Callable[[str, str | None], object]
    ) -> None:
        self._blobs = store
        self._job_id = job_id
        self._note = note
        self._sizes: dict[int, int] | None = None

    def keep(self, spp: int, png: bytes) -> None:
        """Keep a picture, and delete the least useful ones while there are too many."""
        if self._sizes is None:
            listing = self._blobs.listing(blobs.previews(self._job_id))
            self._sizes = {blobs.spp_of_preview(one.name): one.size for one in listing}
        blob = blobs.preview(self._job_id, spp)
        self._note(blob, hashlib.sha256(png).hexdigest())
        self._blobs.put(blob, png)
        self._sizes[spp] = len(png)
        while _are_too_many(self._sizes):
            gone = missed_least(sorted(self._sizes))
            self._blobs.delete(blobs.preview(self._job_id, gone))
            self._note(blobs.preview(self._job_id, gone), None)
            del self._sizes[gone]


def kept(store: Blobs, job_id: str) -> list[int]:
    """Return the spp of the job's previews, in order."""
    return sorted(blobs.spp_of_preview(name) for name in store.names(blobs.previews(job_id)))


def missed_least(spps: list[int]) -> int:
    """Return the spp whose neighbours have the smallest ratio; never the first or the last.

    Noise falls with the square root of spp, so equal ratios of spp are equal steps to the eye.
    """
    ratios = [after / before for before, after in pairwise(spps)]
    gaps = [one * next_one for one, next_one in pairwise(ratios)]
    return spps[1 + gaps.index(min(gaps))]


def _are_too_many(sizes: dict[int, int]) -> bool:
    return len(sizes) > MOST or (len(sizes) > LEAST and sum(sizes.values()) > MOST_BYTES)
