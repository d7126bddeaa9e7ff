"""Uploads partials and commits their slices while the next slice renders."""

import hashlib
import logging
import queue
import random
import threading
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from farm import blobs
from farm.blobs import Blobs
from farm.errors import StoreUnavailable
from farm.exr import Partial, encode_partial
from farm.queue import Committed, Lease, SliceQueue, SliceRecord
from worker.render_child import Loaded

_LOG = logging.getLogger(__name__)

#: Rendered slices that may wait for their upload, so that memory stays bounded.
_WAITING: Final = 2
_FIRST_DELAY_S: Final = 0.1
_LONGEST_DELAY_S: Final = 5.0


@dataclass(frozen=True, kw_only=True)
class Rendered:
    """A slice that is rendered but not yet committed."""

    lease: Lease
    scene: Loaded
    film: NDArray[np.float32]
    first_seed: int
    last_seed: int
    render_s: float


class Uploader:
    """A thread that puts partials into the blob store and commits them, in order.

    While Redis or the blob store is away it tries again, with jitter, for as long as it takes:
    a rendered slice is not thrown away because a server was.
    """

    def __init__(self, store: Blobs, slices: SliceQueue, worker_id: str) -> None:
        self._blobs = store
        self._queue = slices
        self._worker = worker_id
        self._waiting: queue.Queue[Rendered | None] = queue.Queue(_WAITING)
        self._held: dict[str, Lease] = {}
        self._give_up = threading.Event()
        self._thread = threading.Thread(target=self._run, name="uploader", daemon=True)
        self._thread.start()

    def submit(self, rendered: Rendered) -> None:
        """Take over a rendered slice; waits where too many are waiting already."""
        self._held[rendered.lease.entry] = rendered.lease
        self._waiting.put(rendered)

    @property
    def leases(self) -> tuple[Lease, ...]:
        """The leases to keep alive until their slices are committed."""
        return tuple(self._held.values())

    def close(self, patience_s: float) -> None:
        """Commit what is waiting, for so long at most."""
        deadline = threading.Timer(patience_s, self._give_up.set)
        deadline.daemon = True
        deadline.start()
        self._waiting.put(None)
        self._thread.join()
        deadline.cancel()

    def _run(self) -> None:
        while (rendered := self._waiting.get()) is not None:
            delay_s = _FIRST_DELAY_S
            while not self._give_up.is_set():
                try:
                    self._upload(rendered)
                    break
                except StoreUnavailable as error:
                    _LOG.warning("slice %d waits: %s", rendered.lease.index, error)
                    self._give_up.wait(delay_s * random.uniform(0.5, 1.5))
                    delay_s = min(2 * delay_s, _LONGEST_DELAY_S)
            del self._held[rendered.lease.entry]

    def _upload(self, rendered: Rendered) -> None:
        lease, spec = rendered.lease, rendered.lease.spec
        content = encode_partial(
            Partial(
                job_id=lease.job_id,
                index=lease.index,
                first_seed=rendered.first_seed,
                last_seed=rendered.last_seed,
                spp=spec.slice_spp,
                variant=lease.variant,
                scene_sha256=lease.scene_sha256,
                pixels=rendered.film,
            )
        )
        name = blobs.partial(lease.job_id, lease.index, f"{self._worker}-{lease.tries}")
        self._blobs.put(name, content)
        record = SliceRecord(
            index=lease.index,
            spp=spec.slice_spp,
            first_seed=rendered.first_seed,
            last_seed=rendered.last_seed,
            blob=name,
            sha256=hashlib.sha256(content).hexdigest(),
            worker=self._worker,
            render_s=rendered.render_s,
        )
        answer = self._queue.commit(
            lease,
            record,
            width=rendered.scene.width,
            height=rendered.scene.height,
            notes=rendered.scene.notes,
        )
        if answer is Committed.OVERLAP:
            self._queue.fail(
                lease, f"slice {lease.index} would repeat samples of another: its seeds overlap"
            )
        if answer not in {Committed.COMMITTED, Committed.DUPLICATE}:
            _LOG.info("slice %d of job %s: %s", lease.index, lease.job_id, answer.value)
            self._blobs.delete(name)
