"""The monitor: owns jobs while they run, and ends them.

Any number of monitors may run. Each takes the jobs that nobody owns and keeps its ownership alive
from a thread of its own, so that a long evaluation does not cost it a job.
"""

import logging
import threading
import time
from collections import deque
from typing import Final

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.members import process_id, sign_on
from plateau.farm.ledger.ownership import Ownership, Ownerships
from plateau.farm.ledger.totals import MonitorWork
from plateau.farm.model.errors import BlobsUnavailable, FenceLost, Incompatible, StoreUnavailable
from plateau.farm.process import log
from plateau.farm.process.backoff import Backoff
from plateau.farm.process.lifecycle import show_life
from plateau.farm.process.settings import Settings
from plateau.farm.process.stop import Stop
from plateau.farm.redis import keys
from plateau.farm.redis.link import connect, connect_to_renew
from plateau.farm.redis.wake import Wake
from plateau.service.judging.judge import warm_up
from plateau.service.monitor.job_run import JobRun, give_up
from plateau.service.monitor.look_ahead import Crew
from plateau.service.monitor.sweeper import sweeping
from plateau.service.monitor.webhooks.deliverers import delivering

_LOG = logging.getLogger(__name__)

_IDLE_S: Final = 1.0  #: between two looks at the jobs, where no hint came
_ROUNDS_SHARE: Final = 0.1  #: of a monitor's time, where looking at all of its jobs takes long,
_LONGEST_IDLE_S: Final = 5.0  #: as far as this is not too long between two looks
_ROUND_S: Final = 0.1  #: so long jobs are looked at of which no hint came, till those are that have
_CENSUS_S: Final = 2.0  #: between two counts of the workers
_RETRY_S: Final = (0.5, 10.0)  #: the first and the longest wait where something is away
_AGAIN_S: Final = 0.3  #: before a renewal is repeated the first time, so that no lease runs out


class _Waiting:
    """Until when a job is left alone, since something that it needs is away."""

    def __init__(self) -> None:
        self._backoff = Backoff(*_RETRY_S)
        self.until = 0.0

    def again(self) -> None:
        self.until = time.monotonic() + self._backoff.delay_s()


class Monitor:
    """One monitor."""

    def __init__(self, settings: Settings, store: Blobs) -> None:
        if settings.redis_url is None:
            raise ValueError("a monitor needs redis_url")
        self.id = process_id()
        client = self._client = connect(settings.redis_url)
        self._blobs = store
        self._jobs = Jobs(client)
        self._owners = Ownerships(client, settings.lease_s)
        renewing = connect_to_renew(settings.redis_url, settings.lease_s)
        self._renewals = Ownerships(renewing, settings.lease_s)
        self._work = MonitorWork(renewing, self.id, settings.lease_s)
        self._wake = Wake(client, keys.WAKE_MONITORS)
        self._lease_s = settings.lease_s
        self._is_patient = settings.when_refused == "wait"
        self._stop = Stop()
        self._alive_file = settings.alive_file
        self._keeps_sums = settings.keep_sums_days > 0
        self._owned: dict[str, Ownership] = {}
        self._runs: dict[str, JobRun] = {}
        self._waiting: dict[str, _Waiting] = {}  # jobs of ours that lack something for now
        self._others: set[str] = set()  # jobs that other monitors owned a moment ago
        self._others_due = float("-inf")  # when they are asked for again
        self._taken_at = float("-inf")  # when we last looked which jobs there are
        self._fresh: deque[str] = deque()  # jobs just taken, of which no hint may come
        self._round: deque[str] = deque()  # jobs of ours still to be looked at in this round
        self._round_due = float("-inf")  # when the next one begins
        self._round_s = 0.0  # spent in this one
        self._crew = Crew(())
        self._counted_at = float("-inf")

    def run(self, stop: Stop) -> None:
        """Run jobs until `stop` is set; then leave them to the next monitor.

        Raises
        ------
        Refused
            It does not speak what the farm does, and is not to wait for that.
        """
        self._stop = stop
        self._sign_on()
        warm_up()  # a compiler at work would hold up the renewal of ownership
        over = threading.Event()
        renewer = threading.Thread(
            target=self._keep_owning, args=(over,), name="renewer", daemon=True
        )
        renewer.start()
        backoff = Backoff(*_RETRY_S)
        hinted: set[str] = set()
        try:
            while not stop.is_set():
                try:
                    self._look(hinted)
                    busy = self._fresh or self._round
                    hinted = self._wake.wait(0.0 if busy else _IDLE_S, stop)
                    backoff.reset()
                except StoreUnavailable as error:
                    _LOG.warning("%s", error)
                    stop.wait(backoff.delay_s())
        finally:
            over.set()
            renewer.join()
            self._disown()

    def _sign_on(self) -> None:
        """Say that the monitor lives, as soon as Redis answers and the farm lets it in."""
        backoff = Backoff(*_RETRY_S)
        while not self._stop.is_set():
            try:
                sign_on(
                    self._client,
                    "monitor",
                    lambda: self._work.heartbeat(0),
                    self._stop,
                    patient=self._is_patient,
                )
            except StoreUnavailable as error:
                _LOG.warning("%s", error)
                self._stop.wait(backoff.delay_s())
            else:
                return

    def _look(self, hinted: set[str]) -> None:
        """Take the jobs that nobody owns, and bring ours forward: those first that a hint was of.

        All others have their turn in rounds, since hints may be lost. A round that takes long, as
        it does where a thousand jobs wait, is broken off and gone on with after the next hints; and
        the next one is put off, so that a monitor whose jobs all wait has little to do.
        """
        self._take(hinted)
        crew = self._living()
        for job_id in [one for one in self._owned if one in hinted]:
            if self._stop.is_set():  # another monitor may have the rest
                return
            self._bring_forward(job_id, crew)
        now = time.monotonic()
        self._bring_all_forward(self._fresh, hinted, now + _ROUND_S, crew)
        self._go_round(hinted, now + _ROUND_S, crew)

    def _go_round(self, hinted: set[str], until: float, crew: Crew) -> None:
        started = time.monotonic()
        if not self._round and started >= self._round_due:
            self._round, self._round_s = deque(self._owned), 0.0
        if not self._round:
            return
        self._bring_all_forward(self._round, hinted, until, crew)
        ended = time.monotonic()
        self._round_s += ended - started
        if not self._round:
            pause_s = max(_IDLE_S, self._round_s / _ROUNDS_SHARE)
            self._round_due = ended + min(pause_s, _LONGEST_IDLE_S)

    def _bring_all_forward(
        self, waiting: deque[str], hinted: set[str], until: float, crew: Crew
    ) -> None:
        """Bring these jobs forward but for those of a hint, for so long."""
        while waiting and time.monotonic() < until and not self._stop.is_set():
            job_id = waiting.popleft()
            if job_id in self._owned and job_id not in hinted:
                self._bring_forward(job_id, crew)

    def _take(self, hinted: set[str]) -> None:
        """Own the jobs that nobody owns.

        Those that others own are asked for when they are given back, and now and then: a monitor
        that died gives nothing back. So what one monitor does costs the others next to nothing.
        """
        now = time.monotonic()
        free = {hint for hint in hinted if hint.startswith(keys.FREE)}
        self._others -= {hint.removeprefix(keys.FREE) for hint in free}
        if now >= self._others_due:
            self._others, self._others_due = set(), now + self._lease_s / 3
        elif now < self._taken_at + _IDLE_S and hinted <= self._owned.keys() | self._others:
            return
        self._taken_at = now
        unknown = self._owners.unfinished() - self._owned.keys() - self._others
        for job_id in self._owners.by_age(unknown):
            owned = self._owners.acquire(job_id)
            if owned is None:
                self._others.add(job_id)
            else:
                self._owned[job_id] = owned
                self._fresh.append(job_id)

    def _bring_forward(self, job_id: str, crew: Crew) -> None:
        """Advance one job, unless it waits; whatever it lacks, the others go on."""
        waiting = self._waiting.get(job_id)
        if waiting is None or time.monotonic() >= waiting.until:
            with log.concerning(job_id):
                self._bring_one_forward(self._owned[job_id], crew)

    def _bring_one_forward(self, owned: Ownership, crew: Crew) -> None:
        job_id = owned.job_id
        try:
            done = self._advance(owned, crew)
        except BlobsUnavailable as error:
            _LOG.warning("the job waits: %s", error)
            self._waiting.setdefault(job_id, _Waiting()).again()
            return
        except (Incompatible, StoreUnavailable):
            raise
        except Exception:  # noqa: BLE001  (one job's trouble must not hurt the others)
            _LOG.exception("the job waits: it can neither go on nor be given up")
            self._waiting.setdefault(job_id, _Waiting()).again()
            return
        self._waiting.pop(job_id, None)
        if done:
            del self._owned[job_id]
            self._runs.pop(job_id, None)

    def _advance(self, owned: Ownership, crew: Crew) -> bool:
        """Bring one job forward; returns whether we have done with it."""
        try:
            run = self._runs.get(owned.job_id)
            if run is None:
                run = JobRun(
                    owned,
                    self._jobs,
                    self._owners,
                    self._blobs,
                    self._work,
                    keeps_sums=self._keeps_sums,
                )
                self._runs[owned.job_id] = run
            return run.advance(crew)
        except FenceLost as lost:
            _LOG.warning("%s", lost)
            return True
        except (Incompatible, StoreUnavailable):
            raise
        except Exception as error:  # noqa: BLE001  (one job's trouble must not hurt the others)
            _LOG.exception("the job cannot go on")
            return give_up(owned, self._owners, f"the merge cannot go on: {error}")

    def _living(self) -> Crew:
        """The workers that live, as of a moment ago."""
        if time.monotonic() > self._counted_at + _CENSUS_S:
            self._crew = Crew(self._jobs.workers(self._lease_s))
            self._counted_at = time.monotonic()
        return self._crew

    def _keep_owning(self, over: threading.Event) -> None:
        backoff, wait_s = Backoff(_AGAIN_S, self._lease_s / 3), self._lease_s / 3
        while not over.wait(wait_s):
            show_life(self._alive_file)
            owned, wait_s = tuple(self._owned.values()), self._lease_s / 3
            try:
                self._renewals.renew(owned)
                self._work.heartbeat(len(owned))
                backoff.reset()
            except StoreUnavailable as error:
                _LOG.warning("ownership was not renewed: %s", error)
                wait_s = min(wait_s, backoff.delay_s())

    def _disown(self) -> None:
        try:
            self._owners.disown(tuple(self._owned.values()))
            self._work.sign_off()
        except StoreUnavailable as error:
            _LOG.warning("%s", error)


def run(settings: Settings, stop: Stop) -> None:
    """Run one monitor against ``settings.redis_url`` and ``settings.blobs`` until `stop` is set."""
    if settings.blobs is None:
        raise ValueError("a monitor needs blobs")
    store = Blobs(settings.blobs)
    monitor = Monitor(settings, store)
    log.identify(monitor=monitor.id)
    with sweeping(settings, store), delivering(settings):
        monitor.run(stop)
