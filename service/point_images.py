"""Merged images of points of a curve, made again from the slices that the job kept.

They cost a read of every slice up to the point, so they are bounded: one is made at a time, few may
be waited for, none goes on for a client that has gone, and some sums are remembered, from which
later points go on.
"""

import asyncio
import hashlib
import threading
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from farm.blobs import Blobs
from farm.errors import CorruptPartial
from farm.exr import Pixels, decode_partial
from service.merge import normalised

#: The largest film: 4K of cinemas. Merging it takes 0.4 GB.
MOST_PIXELS: Final = 4096 * 2160
#: So many may be waited for, by all clients of a process together.
MOST_WAITING: Final = 8
#: So many bytes of sums are remembered; the newest one in any case.
_REMEMBERED: Final = 128 << 20
#: So often a client is asked whether it is still there, in seconds.
_ASKED_EVERY_S: Final = 0.25

Sum = NDArray[np.float64]


class TooManyWait(Exception):
    """So many images are waited for that one more would take too long."""


class SliceLost(Exception):
    """A slice is gone or spoiled."""


@dataclass(frozen=True)
class KeptSlice:
    """Where a slice lies, and what it has to be."""

    blob: str
    sha256: str


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
        # By job and number of slices, the longest unused first; the worker's alone.
        self._sums: OrderedDict[tuple[str, int], Sum] = OrderedDict()

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
        total = self._merged(job_id, slices, gone)
        return None if total is None else encode(normalised(total))

    def _merged(
        self, job_id: str, slices: Sequence[KeptSlice], gone: threading.Event
    ) -> Sum | None:
        """The sum of the slices, added in order in float64 as the monitor does."""
        done, total = self._remembered(job_id, len(slices))
        for index in range(done, len(slices)):
            if gone.is_set() or self._closed.is_set():
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
            content = self._blobs.get(kept.blob)
            if hashlib.sha256(content).hexdigest() != kept.sha256:
                raise CorruptPartial("it is not what its worker uploaded")
            return decode_partial(content).pixels
        except FileNotFoundError as error:
            raise SliceLost(f"slice {index} is gone") from error
        except CorruptPartial as error:
            raise SliceLost(f"slice {index} is spoiled: {error}") from error
