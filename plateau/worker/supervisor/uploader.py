"""Uploads partials and commits their slices while the next slice renders."""

import hashlib
import logging
import queue
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.images.channels import Channels
from plateau.farm.images.exr import Partial, encode_partial
from plateau.farm.images.view_transform import ViewTransform
from plateau.farm.ledger.queue import Lease, SliceQueue, SliceRecord
from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.model.slices.zones import Zone
from plateau.farm.process import log
from plateau.farm.process.hang import Hang
from plateau.farm.process.waits import Backoff
from plateau.worker.renderers.contract import Loaded
from plateau.worker.supervisor.child_process import Film

_LOG = logging.getLogger(__name__)

#: Rendered slices that may wait for their upload, so that memory stays bounded.
_WAITING: Final = 2
_POLL_S: Final = 0.2  #: between two checks whether the worker stops
_LAST_TRY_S: Final = 3.0  #: how much longer the try under way may take when the patience ends
_RETRY_S: Final = (0.1, 5.0)  #: the first and the longest wait for Redis or the blob store


@dataclass(frozen=True, kw_only=True)
class Rendered:
    """A slice that is rendered but not yet committed."""

    lease: Lease
    scene: Loaded
    film: Film
    first_seed: int
    last_seed: int
    render_s: float
    said: str  #: what the render child printed meanwhile
    zones: tuple[Zone, ...] = ()  #: the parts of the film that were rendered; none for all of it
    kind: str = ""  #: of the worker, see `plateau.worker.supervisor.kinds`
    inputs: Mapping[int, Film] = field(default_factory=dict)  #: see `RenderChild.inputs`


@dataclass(frozen=True, kw_only=True)
class Glimpse:
    """The first pass of a job's first slice, shown until the slice is committed."""

    lease: Lease
    scene: Loaded
    film: Film
    spp: int
    first_seed: int
    zones: tuple[Zone, ...] = ()
    kind: str = ""


class Uploader:
    """A thread that puts partials into the blob store and commits them, in order.

    While Redis or the blob store is away it tries again, with jitter, for as long as it takes: a
    rendered slice is not thrown away because a server is down.
    """

    def __init__(self, store: Blobs, slices: SliceQueue, worker_id: str) -> None:
        self._blobs = store
        self._queue = slices
        self._worker = worker_id
        self._waiting: queue.Queue[Rendered | Glimpse | None] = queue.Queue(_WAITING)
        self._held: dict[str, Rendered] = {}
        self._give_up = threading.Event()
        self._thread = threading.Thread(target=self._run, name="uploader", daemon=True)
        self._thread.start()
        self._hang = Hang(self._thread, store)

    def submit(self, rendered: Rendered, stop: threading.Event) -> bool:
        """Take over a rendered slice; wait while too many are queued.

        Returns False if `stop` is set before there is room.
        """
        self._held[rendered.lease.entry] = rendered
        while True:
            try:
                self._waiting.put(rendered, timeout=_POLL_S)
            except queue.Full:
                if stop.is_set():
                    self._held.pop(rendered.lease.entry, None)
                    return False
            else:
                return True

    def show(self, glimpse: Glimpse) -> None:
        """Take over a glimpse without waiting: it is dropped if the queue is full."""
        with suppress(queue.Full):
            self._waiting.put_nowait(glimpse)

    @property
    def leases(self) -> tuple[Lease, ...]:
        """The leases to keep alive until their slices are committed; none while it hangs."""
        if self.is_hung:
            return ()
        return tuple(rendered.lease for rendered in tuple(self._held.values()))

    @property
    def is_hung(self) -> bool:
        """Whether it waits for a blob store that does not answer, and that nothing ends."""
        return self._hang.is_seen()

    def close(self, patience_s: float) -> None:
        """Commit the queued slices, for this long at most, and give the others back.

        A silent blob store may hold up a try for longer. That try is abandoned; should it still
        commit, the first commit of its slice counts.
        """
        ends = time.monotonic() + patience_s
        while self._thread.is_alive() and time.monotonic() < ends + _LAST_TRY_S:
            with suppress(queue.Full):
                self._waiting.put(None, timeout=_POLL_S)
            self._thread.join(_POLL_S)
            if time.monotonic() > ends:
                self._give_up.set()
        for rendered in tuple(self._held.values()):
            self._give_back(rendered)

    def _run(self) -> None:
        while (one := self._waiting.get()) is not None:
            log.concern(one.lease.job_id, one.lease.index)
            if isinstance(one, Glimpse):
                self._show(one)
                continue
            self._deliver(one)
            # Its lease may have run out meanwhile, and been this worker's again: it is here twice.
            self._held.pop(one.lease.entry, None)
            if self._give_up.is_set():
                return

    def _show(self, glimpse: Glimpse) -> None:
        """Store the glimpse for the monitor; if that fails, the slice itself comes soon."""
        lease = glimpse.lease
        name = blobs.glimpse(lease.job_id, self._attempt(lease))
        try:
            self._blobs.put(name, _encoded(glimpse, glimpse.spp, glimpse.first_seed))
            if not self._queue.glimpse(lease, name):
                self._blobs.delete(name)
        except StoreUnavailable as error:
            _LOG.warning("its first pass cannot be shown: %s", error)

    def _deliver(self, rendered: Rendered) -> None:
        lease = rendered.lease
        content = _encoded(rendered, lease.spp, rendered.last_seed)
        name = blobs.partial(lease.job_id, lease.index, self._attempt(lease))
        backoff, stored = Backoff(*_RETRY_S), False
        while not self._give_up.is_set():
            try:
                # Once: where only the commit's answer was lost, the partial may be deleted by now.
                if not stored:
                    self._blobs.put(name, content)
                    stored = True
                self._commit(rendered, name, content)
            except StoreUnavailable as error:
                _LOG.warning("the slice waits: %s", error)
                self._give_up.wait(backoff.delay_s())
            else:
                return
        self._give_back(rendered)

    def _give_back(self, rendered: Rendered) -> None:
        with suppress(StoreUnavailable):  # then the lease runs out
            cause = "the worker stopped before it could be uploaded"
            self._queue.hand_back(rendered.lease, rendered.render_s, cause=cause)

    def _attempt(self, lease: Lease) -> str:
        return f"{self._worker}-{lease.tries}"

    def _commit(self, rendered: Rendered, name: str, content: bytes) -> None:
        lease = rendered.lease
        record = SliceRecord(
            index=lease.index,
            spp=lease.spp,
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
            said=rendered.said,
        )
        if answer == "overlap":
            self._queue.fail(
                lease,
                f"slice {lease.index} would repeat samples of another: its seeds overlap",
                rendered.render_s,
                rendered.said,
            )
        if answer != "committed":
            _LOG.info("the slice does not count: %s", answer)
            self._blobs.delete(name)


def _encoded(rendered: Rendered | Glimpse, spp: int, last_seed: int) -> bytes:
    """A partial as an EXR file: that of a slice, or of its first pass."""
    lease, scene = rendered.lease, rendered.scene
    return encode_partial(
        Partial(
            job_id=lease.job_id,
            index=lease.index,
            first_seed=rendered.first_seed,
            last_seed=last_seed,
            spp=spp,
            variant=lease.variant,
            scene_sha256=lease.scene_sha256,
            pixels=rendered.film,
            channels=Channels(scene.channels, scene.ids, scene.quotients),
            zones=rendered.zones,
            border=scene.border if rendered.zones else 0,
            renderer=rendered.kind,
            transform=ViewTransform.from_text(scene.look)
            if scene.look and lease.index == 0
            else None,
            header=scene.header if lease.index == 0 else {},
            inputs=rendered.inputs if isinstance(rendered, Rendered) else {},
        )
    )
