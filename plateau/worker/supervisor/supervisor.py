"""The worker's supervisor: lease a slice, have the child render it, hand it to the uploader.

It never imports a renderer. A child that crashes, hangs or is killed costs one try of one slice, if
this worker can render anything else. A worker that cannot gives the slice back and takes no work
until it can.
"""

import logging
import os
import threading
import time
from collections.abc import Iterable
from contextlib import suppress
from typing import Final

from plateau.farm.blobs.store import Blobs
from plateau.farm.bundle import BundleError
from plateau.farm.bundle.hashes import FileHashes
from plateau.farm.ledger.queue import Lease, SliceQueue
from plateau.farm.model.errors import CorruptBlob, FilesDiffer, StoreUnavailable, UnreadableJob
from plateau.farm.model.scene_roots import SceneRoot, root_tag
from plateau.farm.model.seeds import SeedsExhausted
from plateau.farm.model.spec.shared import UnfitFilm
from plateau.farm.process import log
from plateau.farm.process.child import HANGS
from plateau.farm.process.hang import Hang
from plateau.farm.process.lifecycle import process_id, show_life
from plateau.farm.process.settings import Settings
from plateau.farm.process.waits import Backoff, Stop, await_any
from plateau.farm.redis import keys
from plateau.farm.redis.link import connect, connect_to_renew
from plateau.farm.redis.wake import Wake
from plateau.worker.renderers.contract import SceneError
from plateau.worker.supervisor import needed_libraries
from plateau.worker.supervisor.about import About
from plateau.worker.supervisor.child_process import START_TIMEOUT_S, Cancelled, ChildDied
from plateau.worker.supervisor.health import Health
from plateau.worker.supervisor.host import RenderHost
from plateau.worker.supervisor.kinds import Kinds
from plateau.worker.supervisor.pace import Pace
from plateau.worker.supervisor.placed_files import PlacedFiles
from plateau.worker.supervisor.reports import DRAIN_S, RETRY_S, Reports, Tried
from plateau.worker.supervisor.scene_cache import SceneCache
from plateau.worker.supervisor.uploader import Rendered, Uploader
from plateau.worker.supervisor.variants import VariantChoice, choose

_LOG = logging.getLogger(__name__)

# Of a pair, the first is the first wait and the second the longest.
_TURN_S: Final = 20.0  #: how long a worker keeps to its loaded scene before it looks who waits
_IDLE_S: Final = (0.5, 5.0)  #: between two requests for work, unless the worker is woken
_LISTEN_S: Final = 60.0  #: how long a listener waits for one announcement
_FINISH_S: Final = 2.0  #: a stopping worker finishes a slice that ends within this time
_STOPS: Final = "the worker stops"
_AGAIN_S: Final = 0.3  #: before a failed heartbeat is repeated, so that no lease runs out
_SIT_OUT_S: Final = (10.0, 300.0)  #: before a worker that cannot render tests itself again


class Supervisor:
    """One worker."""

    def __init__(self, settings: Settings, choice: VariantChoice, store: Blobs, stop: Stop) -> None:
        if settings.redis_url is None:
            raise ValueError("a worker needs redis_url")
        self.id = process_id()
        self._settings, self._store = settings, store
        self._choice = choice
        self._client = connect(settings.redis_url)
        threads = settings.threads or len(os.sched_getaffinity(0))
        roots = _there(settings.scene_roots)
        tags = (*settings.tags, *(root_tag(root.name) for root in roots))
        self._queue = SliceQueue(
            self._client,
            self.id,
            settings.lease_s,
            pool=settings.pool,
            tags=tags,
            threads=threads,
        )
        renewing = connect_to_renew(settings.redis_url, settings.lease_s)
        self._renewals = SliceQueue(renewing, self.id, settings.lease_s)
        loading_s = START_TIMEOUT_S + settings.child_timeout_s
        placed = PlacedFiles(roots, FileHashes(settings.hashes))
        scenes = SceneCache(store, settings.cache / "scenes", in_use_s=loading_s, placed=placed)
        self._kinds = Kinds(settings.cache, choice)
        self._host = RenderHost(settings, threads, choice.llvm_library, scenes, self._kinds)
        self._uploader = Uploader(store, self._queue, self.id)
        self._health = Health(settings.cache, self._kinds)
        self._reports = Reports(self._queue, stop)
        self._stop = stop
        self._rendering: Lease | None = None
        self._turning = threading.Lock()  # so that a cancel hits no later slice
        self._pace = Pace()
        self._turn: tuple[str, float] = ("", 0.0)  # the job rendered last, and since when
        self._about = About(self.id, settings, choice.variants, tags, threads)

    # This thread renders. Others renew the leases, listen for jobs that end, and wait for a stop.

    def run(self) -> None:
        """Work until told to stop, then give back the current slice and commit rendered ones."""
        self._hang = Hang(threading.current_thread(), self._store)
        over = Stop()
        watchers = [
            threading.Thread(target=watch, args=(over,), name=name, daemon=True)
            for name, watch in (
                ("heartbeat", self._keep_alive),
                ("listener", self._listen),
                ("stopper", self._cancel_on_stop),
            )
        ]
        for watcher in watchers:
            watcher.start()
        try:
            if not self._choice.renders:
                self._about.trouble = self._choice.why
                self._sit_out(self._choice.variant)
            self._host.warm_up(self._choice.variant)
            self._about.machine.look_at_devices()
            self._work()
        finally:
            self._host.close()
            self._uploader.close(DRAIN_S)
            over.set()
            for watcher in watchers:
                watcher.join()
            self._sign_off()

    def _work(self) -> None:
        new_work = Wake(self._client, keys.wake_worker(self.id))
        backoff, idle = Backoff(*RETRY_S), Backoff(*_IDLE_S)
        worked_at = time.monotonic()
        while not self._stop.is_set():
            try:
                lease = self._next_lease()
                if lease is None and self._may_leave(worked_at):
                    return
                wait_s = min(idle.delay_s(), self._queue.look_again_s)
                if lease is not None or new_work.wait(wait_s, self._stop):
                    idle.reset()
            except UnreadableJob as error:  # which others are offered now
                self._note(str(error))
                continue
            except (StoreUnavailable, OSError) as error:
                self._note(str(error))
                self._stop.wait(backoff.delay_s())
                continue
            if lease is not None:
                with log.concerning(lease.job_id, lease.index):
                    if not self._serve(lease):
                        self._stop.wait(backoff.delay_s())
                        continue
                worked_at = time.monotonic()
            backoff.reset()

    def _may_leave(self, worked_at: float) -> bool:
        """Return whether it has waited for work as long as it is meant to."""
        leave_after_s = self._settings.leave_after_s
        if leave_after_s is None or time.monotonic() < worked_at + leave_after_s:
            return False
        _LOG.info("it has done nothing for %g s: the worker stops", leave_after_s)
        return True

    def _next_lease(self) -> Lease | None:
        if self._uploader.is_hung:
            return None
        job, since = self._turn
        in_turn = time.monotonic() < since + _TURN_S
        return self._queue.lease(self._choice.variants, job, in_turn=in_turn)

    def _serve(self, lease: Lease) -> bool:
        """Render one slice and report its outcome; return False if Redis, blobs or disk failed."""
        if lease.job_id != self._turn[0]:
            self._turn = (lease.job_id, time.monotonic())
        started = time.monotonic()
        self._pace.began(lease.job_id)
        self._rendering = lease
        try:
            if (trouble := self._kinds.trouble(lease.variant)) is not None:
                self._give_up(lease, trouble, self._tried(started))
            elif not self._uploader.submit(self._render(lease), self._stop):
                self._reports.hand_back(lease, _STOPS, self._tried(started))
        except Cancelled:
            why = _STOPS if self._stop.is_set() else "it was cancelled"
            self._reports.hand_back(lease, why, self._tried(started))
        except (SceneError, BundleError, SeedsExhausted, UnfitFilm) as error:
            tried = self._tried(started)
            if self._is_fit(lease, f"the scene cannot be rendered: {error}", tried):
                self._reports.fail(lease, str(error), tried)
        except FilesDiffer as error:
            self._about.failed(f"job {lease.job_id}: {error}")
            _LOG.warning("%s", error)
            self._reports.hand_back(lease, str(error), self._tried(started), leaves_out=True)
        except FileNotFoundError:
            tried = self._tried(started)
            absent = f"the blob store has no scene {lease.scene_sha256}"
            if self._is_fit(lease, absent, tried):
                self._reports.fail(lease, absent, tried)
        except (ChildDied, CorruptBlob) as error:
            tried = self._tried(started)
            if self._is_fit(lease, str(error), tried):
                self._reports.died(lease, str(error), tried)
        except (StoreUnavailable, OSError) as error:  # the latter: this machine's disk is full
            self._note(str(error))
            self._reports.hand_back(lease, str(error), self._tried(started))
            return False
        finally:
            with self._turning:
                self._rendering = None
        return True

    def _tried(self, started: float) -> Tried:
        return Tried(time.monotonic() - started, self._host.take_words())

    def _render(self, lease: Lease) -> Rendered:
        rendered = self._host.render(lease, self._uploader.show)
        self._pace.took(lease.job_id, rendered.render_s)
        self._about.rendered(rendered)
        self._about.machine.look_at_devices()
        return rendered

    def _is_fit(self, lease: Lease, error: str, tried: Tried) -> bool:
        """Return whether this worker can render anything else, so that the scene is to blame."""
        _LOG.warning("%s", error)
        self._about.failed(f"slice {lease.index} of job {lease.job_id}: {error}")
        trouble = self._health.trouble(lease.variant)
        if trouble is not None:
            self._give_up(lease, trouble, tried)
        return trouble is None

    def _give_up(self, lease: Lease, trouble: str, tried: Tried) -> None:
        """Return the slice; if this worker's own variant fails, take no work until it works."""
        own, tried = self._choice.variant, Tried(0.0, tried.said)
        fit = lease.variant != own and self._health.trouble(own) is None
        self._reports.hand_back(lease, trouble, tried, unfit=not fit, leaves_out=fit)
        if fit:
            self._note(trouble)
        else:
            self._rendering = None
            self._about.trouble = trouble
            self._sit_out(own)

    def _sit_out(self, variant: str) -> None:
        """Take no work until this worker can render again."""
        self._host.close()  # its process may hold what is lacking
        backoff, since = Backoff(*_SIT_OUT_S), time.monotonic()
        while self._about.trouble is not None and not self._stop.is_set():
            if self._may_leave(since):
                self._stop.set()
                return
            _LOG.error("out of service: %s", self._about.trouble)
            self._stop.wait(backoff.delay_s())
            self._about.trouble = self._health.trouble(variant)
        _LOG.info("back in service")

    def _cancel_on_stop(self, over: Stop) -> None:
        await_any(self._stop, over)
        while not over.wait(0.1):
            if self._rendering is not None and not self._pace.ends_within(_FINISH_S):
                self._host.cancel()

    def _listen(self, over: Stop) -> None:
        news = Wake(self._client, keys.WAKE_WORKERS)
        while not over.is_set():
            try:
                heard = news.wait(_LISTEN_S, over)
            except StoreUnavailable:
                over.wait(1.0)
                continue
            lease = self._rendering
            if lease is not None and any(_concerns(word, lease) for word in heard):
                self._cancel(lease)

    def _cancel(self, lease: Lease) -> None:
        """Cancel a lost slice. Its scene is loaded to the end: the job's next one needs it, too."""
        with suppress(StoreUnavailable):  # the next heartbeat tries again
            if not self._host.is_loading or self._renewals.ended(lease.job_id):
                with self._turning:
                    if lease is self._rendering:
                        self._host.cancel()

    def _keep_alive(self, over: threading.Event) -> None:
        backoff = Backoff(_AGAIN_S, self._settings.heartbeat_s)
        while True:
            wait_s = self._settings.heartbeat_s
            hangs = self._hang.is_seen()
            trouble = self._about.trouble or self._host.trouble
            if hangs or self._uploader.is_hung:
                trouble = HANGS
            if not hangs:
                show_life(self._settings.alive_file, trouble)
            try:
                rendering = None if hangs else self._rendering
                leases = self._uploader.leases + ((rendering,) if rendering else ())
                lost = self._renewals.heartbeat(
                    self._about.told(rendering, trouble, self._kinds.names()), leases
                )
                if rendering in lost:
                    self._cancel(rendering)
                backoff.reset()
            except StoreUnavailable as error:
                _LOG.warning("no heartbeat: %s", error)
                wait_s = min(wait_s, backoff.delay_s())
            if over.wait(wait_s):
                return

    def _note(self, error: str) -> None:
        self._about.failed(error)
        _LOG.warning("%s", error)

    def _sign_off(self) -> None:
        try:
            self._queue.leave()
        except StoreUnavailable as error:
            _LOG.warning("could not sign off: %s", error)


def _concerns(news: str, lease: Lease) -> bool:
    """Return whether the lease's job has ended, or another try of its slice was committed."""
    return news in {f"ended {lease.job_id}", f"ended {lease.job_id} {lease.entry}"}


def _there(roots: Iterable[SceneRoot]) -> tuple[SceneRoot, ...]:
    """Return the roots that this machine sees; jobs that need another go to other workers."""
    there = []
    for root in roots:
        if root.path.is_dir():
            there.append(root)
        else:
            _LOG.warning("no jobs of the scene root %s: %s is not there", root.name, root.path)
    return tuple(there)


def run(settings: Settings, stop: Stop) -> None:
    """Run one worker against ``settings.redis_url`` and ``settings.blobs`` until `stop` is set."""
    if settings.blobs is None:
        raise ValueError("a worker needs blobs")
    needed_libraries.check()
    choice = choose(settings.cache)
    worker = Supervisor(settings, choice, Blobs(settings.blobs), stop)
    log.identify(worker=worker.id)
    _LOG.info("%s", choice.why)
    worker.run()
