"""Merged images of points of a curve, made again from the slices that the job kept.

They cost a read of every slice up to the point, so they are bounded: one is made at a time, few may
be waited for, and none goes on for a client that has gone.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Final

from plateau.farm.blobs.store import Blobs
from plateau.service.api.points import KeptSlice

if TYPE_CHECKING:
    from plateau.farm.images.exr import Pixels
    from plateau.service.api.points.sums import PointSums

#: The largest film: 4K of cinemas. Merging it takes 0.4 GB.
MOST_PIXELS: Final = 4096 * 2160
#: So many may be waited for, by all clients of a process together.
MOST_WAITING: Final = 8
#: So often a client is asked whether it is still there, in seconds.
_ASKED_EVERY_S: Final = 0.25


class TooManyWait(Exception):
    """So many images are waited for that one more would take too long."""


class PointImages:
    """Makes the merged images of points.

    Parameters
    ----------
    store
        Where the slices are.
    """

    def __init__(self, store: Blobs) -> None:
        self._blobs = store
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="point-images")
        self._waiting = 0
        self._closed = threading.Event()
        self._sums: PointSums | None = None  # the worker's alone

    async def encoded(
        self,
        job_id: str,
        slices: Sequence[KeptSlice],
        encode: Callable[[Pixels], bytes],
        is_gone: Callable[[], Awaitable[bool]],
    ) -> bytes | None:
        """The image of these slices as a file; None where nobody waits for it any more.

        Parameters
        ----------
        job_id
            Whose they are.
        slices
            From the first one on, without a gap; one at least.
        encode
            Makes the file of a (height, width, 3) float32 linear image.
        is_gone
            Whether the client has gone.

        Raises
        ------
        TooManyWait
            Eight images are waited for already.
        SliceLost
            A slice cannot be used.
        """
        if self._waiting >= MOST_WAITING:
            raise TooManyWait
        gone = threading.Event()
        self._waiting += 1
        try:
            work = asyncio.get_running_loop().run_in_executor(
                self._worker, self._made, job_id, slices, encode, gone
            )
            while not (await asyncio.wait([work], timeout=_ASKED_EVERY_S))[0]:
                if await is_gone():
                    work.cancel()
                    return None
            return await work
        finally:
            gone.set()  # whatever ends this ends the work
            self._waiting -= 1

    def close(self) -> None:
        """Give up what is being made."""
        self._closed.set()
        self._worker.shutdown(wait=False, cancel_futures=True)

    def _made(
        self,
        job_id: str,
        slices: Sequence[KeptSlice],
        encode: Callable[[Pixels], bytes],
        gone: threading.Event,
    ) -> bytes | None:
        # Imported when it is first asked for: numpy and the metric take a fifth of an API's start.
        from plateau.service.api.points.sums import PointSums

        if self._sums is None:
            self._sums = PointSums(self._blobs)
        image = self._sums.image(
            job_id, slices, is_given_up=lambda: gone.is_set() or self._closed.is_set()
        )
        return None if image is None else encode(image)
