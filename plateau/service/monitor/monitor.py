"""The monitor: owns jobs while they run, and ends them.

Any number of monitors may run. Each takes the jobs without an owner, and renews its ownership in a
separate thread, so that a long evaluation does not cost it a job.
"""

import logging
import threading
import time
from collections import Counter
from typing import Final

from plateau.farm.blobs.read_ahead import ReadAhead
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Ownership, Ownerships
from plateau.farm.ledger.shots import Shots
from plateau.farm.ledger.workers import MonitorLife, Workers
from plateau.farm.model.errors import (
    BlobsUnavailable,
    FenceLost,
    Incompatible,
    JobNotFound,
    StoreUnavailable,
)
from plateau.farm.model.fit import Crew
from plateau.farm.model.job import Job
from plateau.farm.process import log
from plateau.farm.process.child import HANGS
from plateau.farm.process.hang import Hang
from plateau.farm.process.lifecycle import process_id, show_life
from plateau.farm.process.settings import Settings
from plateau.farm.process.waits import Backoff, Stop
from plateau.farm.redis import keys
from plateau.farm.redis.link import connect, connect_to_renew
from plateau.farm.redis.wake import Wake
from plateau.picture.denoising.process import Denoising
from plateau.picture.judge import warm_up
from plateau.service.monitor.job_run import JobRun, give_up
from plateau.service.monitor.notifier.notifier import notifying
from plateau.service.monitor.notifier.troubles import telling_troubles
from plateau.service.monitor.room import NoRoom, check_room
from plateau.service.monitor.shots.tending import Tending
from plateau.service.monitor.sweeper import sweeping
from plateau.service.monitor.turns import IDLE_S, RETRY_S, Share, Turns
from plateau.service.notices.targets import read_targets

_LOG = logging.getLogger(__name__)

_CENSUS_S: Final = 2.0  #: between two counts of the workers
_MOST_LACKS: Final = 60  #: turns without memory or a process, in a row: some ten minutes
_DENOISED_S: Final = 0.1  #: between two checks whether an image is denoised
_AGAIN_S: Final = 0.3  #: before the first repetition of a failed renewal


class Monitor:
    """Owns jobs, and gives each of them its turns."""

    def __init__(self, settings: Settings, store: Blobs) -> None:
        if settings.redis_url is None:
            raise ValueError("a monitor needs redis_url")
        self.id = process_id()
        client = self._client = connect(settings.redis_url)
        self._blobs = store
        self._ahead = ReadAhead(store)
        self._jobs = Jobs(client)
        self._owners = Ownerships(client, settings.lease_s)
        renewing = connect_to_renew(settings.redis_url, settings.lease_s)
        self._renewals = Ownerships(renewing, settings.lease_s)
        self._life = MonitorLife(renewing, self.id, settings.lease_s)
        self._wake = Wake(client, keys.WAKE_MONITORS)
        self._lease_s = settings.lease_s
        self._stop = Stop()
        self._alive_file = settings.alive_file
        self._keeps_sums = settings.keep_sums_days > 0
        self._owned: dict[str, Ownership] = {}
        self._runs: dict[str, JobRun] = {}
        self._lacks: Counter[str] = Counter()  # by job, turns in a row that lacked something
        self._turns = Turns(time.monotonic)
        self._share = Share(time.monotonic)
        self._denoising = Denoising()
        self._of_runs = self._jobs, self._owners, store, self._ahead, self._denoising
        self._tending = Tending(Shots(client), store)
        self._others: set[str] = set()  # jobs that other monitors owned a moment ago
        self._others_due = float("-inf")  # when to look at them again
        self._taken_at = float("-inf")  # when this monitor last looked for jobs
        self._crew = Crew(())
        self._counted_at = float("-inf")

    def run(self, stop: Stop) -> None:
        """Run jobs until `stop` is set; then leave them to the next monitor.

        Raises `Incompatible` if the data has another layout.
        """
        self._stop = stop
        self._sign_on()
        warm_up()  # compiling later would hold up the renewals
        over = threading.Event()
        hang = Hang(threading.current_thread(), self._blobs)
        renewer = threading.Thread(
            target=self._keep_owning, args=(over, hang), name="renewer", daemon=True
        )
        renewer.start()
        backoff = Backoff(*RETRY_S)
        hinted: set[str] = set()
        try:
            while not stop.is_set():
                try:
                    self._look(hinted)
                    wait_s = self._turns.wait_s
                    if self._denoising.is_busy or self._tending.is_busy:
                        wait_s = min(wait_s, _DENOISED_S)
                    hinted = self._wake.wait(wait_s, stop) | self._denoising.done()
                    backoff.reset()
                except StoreUnavailable as error:
                    _LOG.warning("%s", error)
                    stop.wait(backoff.delay_s())
        finally:
            self._denoising.close()
            self._tending.close()
            self._ahead.close()
            over.set()
            renewer.join()
            self._disown()

    def _sign_on(self) -> None:
        """Register the monitor, as soon as Redis answers."""
        backoff = Backoff(*RETRY_S)
        while not self._stop.is_set():
            try:
                self._life.heartbeat(0)
            except StoreUnavailable as error:
                _LOG.warning("%s", error)
                self._stop.wait(backoff.delay_s())
            else:
                return

    def _look(self, hinted: set[str]) -> None:
        """Take the jobs without an owner, and advance the jobs whose turn it is."""
        self._take(hinted)
        crew = self._living()
        for job_id in self._turns.next_jobs(self._owned, hinted):
            if self._stop.is_set():
                break  # another monitor may take the other turns
            with log.concerning(job_id):
                self._bring_forward(self._owned[job_id], crew)
        if not self._stop.is_set():
            self._tend()

    def _tend(self) -> None:
        """Look at the shots whose frames wait; their troubles do not stop other jobs."""
        try:
            self._tending.advance()
        except BlobsUnavailable as error:
            _LOG.warning("a shot waits: %s", error)
        except (Incompatible, StoreUnavailable):
            raise
        except Exception:  # noqa: BLE001  (one shot's trouble must not hurt the others)
            _LOG.exception("a shot waits: it could not be looked at")

    def _take(self, hinted: set[str]) -> None:
        """Take the jobs without an owner, up to this monitor's share.

        Others' jobs are tried when given back, and now and then, as the dead give nothing back.
        """
        now = time.monotonic()
        free = {hint for hint in hinted if hint.startswith(keys.FREE)}
        self._others -= {hint.removeprefix(keys.FREE) for hint in free}
        if now >= self._others_due:
            self._others, self._others_due = set(), now + self._lease_s / 3
        elif now < self._taken_at + IDLE_S and hinted <= self._owned.keys() | self._others:
            return
        self._taken_at = now
        unfinished = self._owners.unfinished()
        unknown = unfinished - self._owned.keys() - self._others
        if not unknown:
            return
        for job_id in self._share.jobs_to_take(
            self._owners.by_age(unknown),
            self._owned,
            jobs=len(unfinished),
            monitors=self._owners.monitors(),
        ):
            owned = self._owners.acquire(job_id)
            if owned is None:
                self._others.add(job_id)
            else:
                self._owned[job_id] = owned
                self._turns.add(job_id)

    def _bring_forward(self, owned: Ownership, crew: Crew) -> None:
        """Advance one job; its troubles do not stop the others."""
        job_id = owned.job_id
        try:
            done = self._advance(owned, crew)
        except (BlobsUnavailable, OSError, MemoryError) as error:
            _LOG.warning("the job waits: %s", str(error) or "memory is short")
            self._turns.put_off(job_id)
            return
        except (Incompatible, StoreUnavailable):
            raise
        except Exception:  # noqa: BLE001  (one job's trouble must not hurt the others)
            _LOG.exception("the job waits: it can neither continue nor fail")
            self._turns.put_off(job_id)
            return
        self._turns.note_success(job_id)
        self._lacks.pop(job_id, None)
        if done:
            del self._owned[job_id]
            self._runs.pop(job_id, None)
            self._tending.remove(job_id)

    def _advance(self, owned: Ownership, crew: Crew) -> bool:
        """Advance one job, or give it up; returns whether it is finished."""
        try:
            job, run = self._jobs.get(owned.job_id), self._runs.get(owned.job_id)
            if run is None and self._is_waiting(job):
                return False
            is_alone = self._runs.keys() <= {job.id}
            check_room(job, has_sums=run is not None and run.has_sums, is_alone=is_alone)
            if run is None:
                run = JobRun(owned, job, *self._of_runs, keeps_sums=self._keeps_sums)
                self._runs[owned.job_id] = run
            done = run.advance(job, crew)
            if run.waits_for_shot:  # all that it has is stored, and its sums are large
                del self._runs[owned.job_id]
                self._is_waiting(self._jobs.get(owned.job_id))
            return done
        except FenceLost as lost:
            _LOG.warning("%s", lost)
            return True
        except (Incompatible, StoreUnavailable, NoRoom):
            raise
        except JobNotFound as gone:
            return give_up(owned, self._owners, str(gone))
        except (OSError, MemoryError) as error:
            # This machine lacks something, perhaps for a moment. The sums may be half added to.
            self._runs.pop(owned.job_id, None)
            self._lacks[owned.job_id] += 1
            if self._lacks[owned.job_id] < _MOST_LACKS:
                raise
            return give_up(owned, self._owners, f"the merge cannot continue: {error}")
        except Exception as error:  # noqa: BLE001  (one job's trouble must not hurt the others)
            _LOG.exception("the job cannot continue")
            return give_up(owned, self._owners, f"the merge cannot continue: {error}")

    def _is_waiting(self, job: Job) -> bool:
        """Note whether the job is a frame that waits for a look at its shot."""
        if job.in_shot is None or not job.in_shot.is_waiting or job.state.ended:
            self._tending.remove(job.id)
            return False
        self._tending.add(job.id, job.in_shot.id)
        return True

    def _living(self) -> Crew:
        """The living workers, counted anew every two seconds."""
        if time.monotonic() > self._counted_at + _CENSUS_S:
            self._crew = Crew(Workers(self._client).living(self._lease_s))
            self._counted_at = time.monotonic()
        return self._crew

    def _keep_owning(self, over: threading.Event, hang: Hang) -> None:
        """Renew the ownerships until `over` is set, but not while the monitor hangs."""
        every_s = self._lease_s / 3
        backoff, wait_s = Backoff(_AGAIN_S, every_s), every_s
        while not over.wait(wait_s):
            if hang.is_seen():
                _LOG.error("%s: another monitor takes the jobs", HANGS)
                wait_s = every_s
                continue
            show_life(self._alive_file)
            owned, began = tuple(self._owned.values()), time.monotonic()
            try:
                self._renewals.renew(owned)
                self._life.heartbeat(len(owned))
                backoff.reset()
                # The answers' time counts: where Redis is far, a lease would run out meanwhile.
                wait_s = max(0.0, began + every_s - time.monotonic())
            except StoreUnavailable as error:
                _LOG.warning("ownership was not renewed: %s", error)
                wait_s = min(every_s, backoff.delay_s())

    def _disown(self) -> None:
        try:
            self._owners.disown(tuple(self._owned.values()))
            self._life.heartbeat(None)
        except StoreUnavailable as error:
            _LOG.warning("%s", error)


def run(settings: Settings, stop: Stop) -> None:
    """Run one monitor against ``settings.redis_url`` and ``settings.blobs`` until `stop` is set."""
    if settings.blobs is None:
        raise ValueError("a monitor needs blobs")
    store = Blobs(settings.blobs)
    monitor = Monitor(settings, store)
    log.identify(monitor=monitor.id)
    telling = telling_troubles(settings, store, read_targets(settings))
    with sweeping(settings, store), notifying(settings, store), telling:
        monitor.run(stop)
