"""The worker's supervisor: lease a slice, have the child render it, hand it to the uploader.

It never imports Mitsuba. A child that crashes, hangs or is killed costs one try of one slice.
"""

import logging
import os
import random
import secrets
import socket
import tempfile
import threading
import time
from datetime import datetime, timezone
from pathlib import Path
from typing import Final

import psutil

from farm import keys
from farm.blobs import Blobs
from farm.bundle import BundleError
from farm.errors import StoreUnavailable
from farm.queue import Lease, SliceQueue
from farm.redis_link import connect
from farm.seeds import SeedSchedule, SeedsExhausted
from farm.settings import Settings
from farm.wake import Wake
from worker.errors import SceneError
from worker.render_child import Cancelled, ChildDied, ChildLimits, Loaded, RenderChild
from worker.scene_cache import SceneCache
from worker.uploader import Rendered, Uploader
from worker.variants import VariantChoice, choose

_LOG = logging.getLogger(__name__)

_IDLE_S: Final = 0.5  #: between two looks for work, where no hint came
_TURN_S: Final = 20.0  #: a worker keeps to its loaded scene for so long, then looks who waits
_DRAIN_S: Final = 5.0  #: a stopping worker tries to commit what it has for so long
_CHILD_MEMORY_SHARE: Final = 0.8  #: of the machine's memory, where no limit is set


class Supervisor:
    """One worker."""

    def __init__(self, settings: Settings, choice: VariantChoice, store: Blobs) -> None:
        if settings.redis_url is None:
            raise ValueError("a worker needs redis_url")
        self.id = f"{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(2)}"
        self._settings = settings
        self._choice = choice
        self._client = connect(settings.redis_url)
        self._queue = SliceQueue(self._client, self.id, settings.lease_s)
        self._cache = SceneCache(store, settings.cache / "scenes")
        self._uploader = Uploader(store, self._queue, self.id)
        self._threads = settings.threads or len(os.sched_getaffinity(0))
        self._child: RenderChild | None = None
        self._loaded: tuple[tuple[object, ...], Loaded] | None = None
        self._rendering: Lease | None = None
        self._turn: tuple[str, float] = ("", 0.0)  # the job rendered last, and since when
        self._started_at = datetime.now(timezone.utc)
        self._slices_done = 0
        self._samples_per_s: float | None = None
        self._last_error: str | None = None

    # Three threads: this one renders; one renews the leases; one listens for jobs that end.

    def run(self, stop: threading.Event) -> None:
        """Work until `stop` is set; then give back the slice in hand and commit what is done."""
        over = threading.Event()
        watchers = [
            threading.Thread(target=self._keep_alive, args=(over,), daemon=True),
            threading.Thread(target=self._listen, args=(over,), daemon=True),
            threading.Thread(target=self._cancel_when, args=(stop, over), daemon=True),
        ]
        for watcher in watchers:
            watcher.start()
        try:
            with tempfile.TemporaryDirectory(prefix="plateau-worker-") as folder:
                self._work(stop, Path(folder))
        finally:
            if self._child is not None:
                self._child.kill()
            self._uploader.close(_DRAIN_S)
            over.set()
            for watcher in watchers:
                watcher.join()
            self._sign_off()

    def _work(self, stop: threading.Event, folder: Path) -> None:
        assert self._settings.redis_url is not None
        work_there_is = Wake(self._client, keys.WAKE_WORKERS)
        delay_s = _IDLE_S
        while not stop.is_set():
            try:
                lease = self._next_lease()
                if lease is None:
                    work_there_is.wait(_IDLE_S)
                else:
                    self._serve(lease, folder)
                delay_s = _IDLE_S
            except StoreUnavailable as error:
                _LOG.warning("%s", error)
                stop.wait(delay_s * random.uniform(0.5, 1.5))
                delay_s = min(2 * delay_s, 10.0)

    def _next_lease(self) -> Lease | None:
        job, since = self._turn
        in_turn = time.monotonic() < since + _TURN_S
        return self._queue.lease(self._choice.variants, job, in_turn=in_turn)

    def _serve(self, lease: Lease, folder: Path) -> None:
        """Render one slice, whatever comes of it."""
        if lease.job_id != self._turn[0]:
            self._turn = (lease.job_id, time.monotonic())
        started = time.monotonic()
        self._rendering = lease
        try:
            self._render(lease, folder)
        except (SceneError, BundleError, SeedsExhausted) as error:
            self._note(lease, f"the scene cannot be rendered: {error}")
            self._queue.fail(lease, str(error))
        except FileNotFoundError:
            self._note(lease, "the scene is not in the blob store")
            self._queue.fail(lease, f"the blob store has no scene {lease.scene_sha256}")
        except Cancelled:
            self._queue.hand_back(lease, time.monotonic() - started)
        except ChildDied as error:
            self._note(lease, str(error))
            self._queue.died(lease, str(error), time.monotonic() - started)
        finally:
            self._rendering = None

    def _render(self, lease: Lease, folder: Path) -> None:
        spec = lease.spec
        child = self._child_for(lease.variant)
        scene = self._load(child, lease)
        schedule = SeedSchedule(
            variant=lease.variant,
            width=scene.width,
            height=scene.height,
            slice_spp=spec.slice_spp,
            max_spp=spec.max_spp,
            job_seed=spec.seed,
        )
        first_seed, last_seed = schedule.seed_range(lease.index)
        film, render_s = child.render(schedule.passes(lease.index), folder)
        self._uploader.submit(
            Rendered(
                lease=lease,
                scene=scene,
                film=film,
                first_seed=first_seed,
                last_seed=last_seed,
                render_s=render_s,
            )
        )
        self._slices_done += 1
        self._samples_per_s = scene.width * scene.height * spec.slice_spp / render_s

    def _child_for(self, variant: str) -> RenderChild:
        if self._child is not None and self._child.alive and self._child.variant == variant:
            return self._child
        if self._child is not None:
            self._child.kill()
        self._loaded = None
        memory_gb = self._settings.child_memory_gb
        memory = (
            memory_gb * 1e9 if memory_gb else _CHILD_MEMORY_SHARE * psutil.virtual_memory().total
        )
        limits = ChildLimits(
            threads=self._threads,
            memory_bytes=0 if variant.startswith("cuda") else int(memory),
            load_timeout_s=self._settings.load_timeout_s,
            pass_timeout_s=self._settings.pass_timeout_s,
        )
        self._child = RenderChild(
            variant, self._choice.llvm_library, limits, self._settings.cache / "home"
        )
        return self._child

    def _load(self, child: RenderChild, lease: Lease) -> Loaded:
        spec = lease.spec
        parameters = spec.parameter_strings()
        wanted = (lease.scene_sha256, tuple(sorted(parameters.items())), spec.sensor)
        if self._loaded is None or self._loaded[0] != wanted:
            self._loaded = None
            files, entry = self._cache.scene(lease.scene_sha256)
            self._loaded = (wanted, child.load(files, entry, parameters, spec.sensor))
        return self._loaded[1]

    def _cancel(self, job_ids: set[str]) -> None:
        lease, child = self._rendering, self._child
        if lease is not None and child is not None and lease.job_id in job_ids:
            child.cancel()

    def _cancel_when(self, stop: threading.Event, over: threading.Event) -> None:
        while not over.wait(0.1):
            if stop.is_set() and self._rendering is not None:
                self._cancel({self._rendering.job_id})

    def _listen(self, over: threading.Event) -> None:
        news = Wake(self._client, keys.WAKE_WORKERS)
        while not over.is_set():
            try:
                heard = news.wait(0.5)
            except StoreUnavailable:
                over.wait(1.0)
                continue
            self._cancel({word.removeprefix("ended ") for word in heard})

    def _keep_alive(self, over: threading.Event) -> None:
        while True:
            try:
                rendering = self._rendering
                leases = self._uploader.leases + ((rendering,) if rendering else ())
                self._cancel(self._queue.heartbeat(self._about(rendering), leases))
            except StoreUnavailable as error:
                _LOG.warning("no heartbeat: %s", error)
            if over.wait(self._settings.heartbeat_s):
                return

    def _about(self, rendering: Lease | None) -> dict[str, object]:
        return {
            "id": self.id,
            "host": socket.gethostname(),
            "pid": os.getpid(),
            "variants": self._choice.variants,
            "threads": self._threads,
            "job": rendering.job_id if rendering else None,
            "slice": rendering.index if rendering else None,
            "slices_done": self._slices_done,
            "samples_per_s": self._samples_per_s,
            "last_error": self._last_error,
            "started_at": self._started_at.isoformat(),
        }

    def _note(self, lease: Lease, error: str) -> None:
        self._last_error = f"slice {lease.index} of job {lease.job_id}: {error}"
        _LOG.warning("%s", self._last_error)

    def _sign_off(self) -> None:
        try:
            self._queue.leave()
        except StoreUnavailable as error:
            _LOG.warning("could not sign off: %s", error)


def run(settings: Settings, stop: threading.Event) -> None:
    """Run one worker against ``settings.redis_url`` and ``settings.blobs`` until `stop` is set."""
    if settings.blobs is None:
        raise ValueError("a worker needs blobs")
    choice = choose(settings.cache)
    _LOG.info("%s", choice.why)
    Supervisor(settings, choice, Blobs(settings.blobs)).run(stop)
