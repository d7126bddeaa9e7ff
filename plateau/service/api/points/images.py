"""Merged images of points of a curve, made again from the slices that the job kept.

Each costs a read of every slice up to the point. So one is made at a time, few requests may wait,
and the work stops when its client disconnects.
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
    from plateau.farm.images.channels import Colour
    from plateau.farm.images.exr import Pixels
    from plateau.farm.images.view_transform import ViewTransform
    from plateau.service.api.points.sums import PointSums

    #: Makes a file of an image, and of the function that returns its scene's view transform.
    Encode = Callable[[Pixels, Callable[[], ViewTransform | None]], bytes]

#: The largest film of R, G, B and W, cinema's 4K; merging it takes 0.4 GB.
MOST_PIXELS: Final = 4096 * 2160
#: Requests of all clients that may wait in one process.
MOST_WAITING: Final = 8
#: Seconds between two checks whether a client is still connected.
_ASKED_EVERY_S: Final = 0.25


class TooManyWait(Exception):
    """`MOST_WAITING` requests wait already."""


class PointImages:
    """Makes the merged images of points from the slices in the store."""

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
        encode: Encode,
        is_gone: Callable[[], Awaitable[bool]],
        background: Colour = (0.0, 0.0, 0.0),
        zone_size: int | None = None,
    ) -> bytes | None:
        """The merged image of a job's first slices as a file; None once the client has left.

        `encode` makes a file of a (height, width, 3) float32 linear image, which is over
        `background` where it has alpha, and is given a function that returns the view transform of
        the scene, if it has one. `zone_size` is that of a job that is allocated by zones, in
        pixels. Raises `TooManyWait`, or `SliceLost` if a slice is gone or damaged.
        """
        if self._waiting >= MOST_WAITING:
            raise TooManyWait
        gone = threading.Event()
        self._waiting += 1
        try:
            work = asyncio.get_running_loop().run_in_executor(
                self._worker, self._made, job_id, slices, encode, background, zone_size, gone
            )
            while not (await asyncio.wait([work], timeout=_ASKED_EVERY_S))[0]:
                if await is_gone():
                    work.cancel()
                    return None
            return await work
        finally:
            gone.set()  # stops the work, however this ended
            self._waiting -= 1

    def close(self) -> None:
        """Give up the image that is being made, and all that wait."""
        self._closed.set()
        self._worker.shutdown(wait=False, cancel_futures=True)

    def _made(
        self,
        job_id: str,
        slices: Sequence[KeptSlice],
        encode: Encode,
        background: Colour,
        zone_size: int | None,
        gone: threading.Event,
    ) -> bytes | None:
        # Imported at the first use: numpy and the metric take a fifth of the API's start.
        from plateau.service.api.points.sums import PointSums

        if self._sums is None:
            self._sums = PointSums(self._blobs)
        sums = self._sums
        image = sums.image(
            job_id,
            slices,
            is_given_up=lambda: gone.is_set() or self._closed.is_set(),
            background=background,
            zone_size=zone_size,
        )
        return None if image is None else encode(image, lambda: sums.transform(slices))
