"""One job, run by the monitor that owns it: plan, merge, judge, end, and write the results."""

import logging
import time
from typing import Final

from plateau.farm.blobs import store as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Ownership, Ownerships
from plateau.farm.ledger.queue import SliceRecord
from plateau.farm.ledger.totals import MonitorWork
from plateau.farm.model.errors import IllegalTransition
from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from plateau.service.judging.checkpoints import Checkpoints
from plateau.service.judging.films import Films
from plateau.service.judging.judge import Judge, Judgement
from plateau.service.judging.result_files import flaw_of
from plateau.service.monitor.look_ahead import Crew, LookAhead
from plateau.service.monitor.results import Results

_LOG = logging.getLogger(__name__)

_BATCH: Final = 16  #: records read from the ledger at once


class JobRun:
    """The progress of one job. `advance` may be called at any time, and again after any error.

    What it has merged is a prefix of the slices, so it is the same whatever died on the way; a
    monitor that takes over starts from the last checkpoint and comes to the same points.
    """

    def __init__(
        self,
        owned: Ownership,
        jobs: Jobs,
        owners: Ownerships,
        store: Blobs,
        work: MonitorWork,
        *,
        keeps_sums: bool,
    ) -> None:
        self.owned = owned
        self._keeps_sums = keeps_sums
        self._jobs = jobs
        self._owners = owners
        self._blobs = store
        self._work = work
        job = jobs.get(owned.job_id)
        self._spec = job.spec
        self._continued_spp = job.continued_spp
        self._judge = Judge(job.spec)
        self._judgement: Judgement | None = None  # made, but not yet written down
        self._ended = False  # by this monitor, or by someone who was faster
        self._planned_stop = -1
        self._look_ahead = LookAhead(job)
        self._films = Films(owned, owners, store)
        self._results = Results(owned, owners, store, job.spec)
        self._checkpoints = Checkpoints(owned, owners, store, keep_slices=job.spec.keep_slices)
        self._merge = self._checkpoints.recover(job.spec.slice_spp, self._judge)

    def advance(self, crew: Crew) -> bool:
        """Do all that can be done now; returns whether the job is finished with.

        Raises
        ------
        FenceLost
            Another monitor owns the job.
        StoreUnavailable
            Call again later.
        CorruptPartial, ValueError
            A slice cannot be merged, now or later.
        """
        job = self._jobs.get(self.owned.job_id)
        if not job.state.ended:
            enough = crew.enough(job)
            self._plan(enough)
            before = self._merge.slices
            self._merge_and_judge()
            if job.state is JobState.RENDERING and not self._merge.slices:
                self._results.show_glimpse(self._judge)
            self._check_time()
            if self._ended:
                job = self._jobs.get(self.owned.job_id)
            elif self._merge.slices > before:
                self._plan(enough)
        if job.state is JobState.PAUSED and self._merge.slices:
            # It is asked again and again: so all is saved a moment after its last slice came. There
            # is no judgement in hand then that a checkpoint could lose.
            self._results.preview(self._merge, self._judge)
            self._checkpoints.save_all(self._merge, self._judge)
        if job.state.ended:
            self._finish(job)
            return True
        return False

    def _plan(self, enough: int) -> None:
        """Keep so many slices planned beyond the merged ones.

        Not one by one, where they are many: Redis waits for its disk each time.
        """
        stop = self._look_ahead.stop(self._merge.slices, enough)
        if stop - self._planned_stop > (self._planned_stop - self._merge.slices) // 8:
            expected_spp = self._look_ahead.expected_end_spp(self._merge.slices)
            self._owners.plan(self.owned, range(self._merge.slices, stop), expected_spp)
            self._planned_stop = stop

    def _merge_and_judge(self) -> None:
        """Merge what is committed, and judge it wherever the curve has a point.

        What is committed meanwhile is announced, and no reason to look again.
        """
        goes_on = self._judged()
        while goes_on:
            start = self._merge.slices
            records = self._owners.committed(self.owned.job_id, range(start, start + _BATCH))
            goes_on = all(map(self._take, records)) and len(records) == _BATCH

    def _take(self, record: SliceRecord) -> bool:
        """Merge a slice and judge the sum, if it is time; returns whether the job goes on."""
        if not self._add(record):
            return False
        self._checkpoints.note(record.blob)
        if self._spec.evaluates_at(self._merge.spp):
            with self._work.evaluations.timed():
                self._judgement = self._judge.judge(self._merge)
            self._look_ahead.expect(self._judgement.expected_spp)
            return self._judged()
        if self._merge.slices == 1 and not self._is_seen():
            self._results.show(self._merge, self._judge)  # long before the first point
        return True

    def _is_seen(self) -> bool:
        """Whether an image of whole slices is shown."""
        return (self._jobs.get(self.owned.job_id).image_spp or 0) >= self._spec.slice_spp

    def _judged(self) -> bool:
        """Write down the judgement in hand, if any; returns whether the job goes on.

        It stays in hand through an error, for what is merged is not come upon again.
        """
        if self._judgement is None:
            return True
        point, verdict, spp = self._judgement.point, self._judgement.verdict, self._merge.spp
        self._owners.append_point(self.owned, spp, point)
        if self._judgement.flaw is not None:
            self._end_with_results(JobState.FAILED, self._judgement.flaw)
        elif verdict.stop and spp > self._continued_spp:
            self._end_with_results(JobState.CONVERGED, verdict.reason, verdict.numbers)
        elif spp == self._spec.max_spp:
            reason = f"reached the cap of {spp} spp; {verdict.reason}"
            self._end_with_results(JobState.EXHAUSTED, reason)
        else:
            self._results.preview(self._merge, self._judge)
            self._checkpoints.save(self._merge, self._judge)
            self._judgement = None
            return True
        self._judgement = None
        return False

    def _add(self, record: SliceRecord) -> bool:
        """Merge a slice; returns False where its partial is lost or spoiled."""
        started = time.monotonic()
        film = self._films.film(record)
        if film is None:
            return False
        self._merge.add(film)
        self._work.merges.note(time.monotonic() - started)
        return True

    def _check_time(self) -> None:
        """End the job where it took as long as it may; pauses do not count."""
        limit_s = self._spec.time_limit_s
        if limit_s is None:
            return
        job = self._jobs.get(self.owned.job_id)
        counts_waiting = self._spec.time_limit_from == "submission"
        begin = job.created_at if counts_waiting else job.started_at
        if begin is None or job.state not in {JobState.QUEUED, JobState.RENDERING}:
            return
        if self._jobs.now_ms() / 1000 - begin.timestamp() - job.paused_s <= limit_s:
            return
        if not self._merge.slices:  # an end with an image is not to be told from one without
            self._end(
                JobState.FAILED,
                f"no slice of it was rendered within its time limit of {limit_s:g} s",
            )
            return
        reason = f"reached its time limit of {limit_s:g} s at {self._merge.spp} spp"
        flaw = flaw_of(self._merge.image())
        if flaw is None:
            self._end(JobState.EXHAUSTED, reason)
        else:  # there was no point of the curve yet at which it could be judged
            self._end(JobState.FAILED, f"{reason}; {flaw}")

    def _end_with_results(
        self, state: JobState, reason: str, numbers: dict[str, float | None] | None = None
    ) -> None:
        """End the job, and conclude it with this image: nothing can come between the two."""
        results, sha256 = self._results.write(self._merge, self._judge)
        self._end(state, reason, numbers, results, sha256)

    def _end(
        self,
        state: JobState,
        reason: str,
        verdict: dict[str, float | None] | None = None,
        results: str = "",
        sha256: dict[str, str] | None = None,
    ) -> None:
        self._ended = True
        try:
            self._owners.end(self.owned, state, reason, verdict, results, sha256)
        except IllegalTransition as refused:
            _LOG.info("%s", refused)  # it was cancelled, or it failed, a moment ago

    # Results.

    def _finish(self, job: Job) -> None:
        """Write the results of the job's prefix, then clear everything else."""
        if not self._owners.concluded(job.id):
            self._conclude(job)
        kept = self._keep_sums(job)
        self._clear(job, kept)
        self._owners.finish(self.owned, keeps_sums=bool(kept))

    def _keep_sums(self, job: Job) -> set[str]:
        """Save the sums of the whole image, from which another job can go on; returns their blob.

        A job that keeps its slices needs none.
        """
        if self._spec.keep_slices or not self._keeps_sums:
            return set()
        self._merge_up_to(job)
        if self._merge.slices:
            self._checkpoints.save_now(self._merge, self._judge)
        # As Redis has it: another monitor may have saved its own while we were suspended.
        last = self._owners.checkpoint(job.id)
        return set() if last is None else {last.blob}

    def _conclude(self, job: Job) -> None:
        notes = job.notes
        if not self._merge_up_to(job):
            lost = f"the image has {self._merge.spp} spp: a slice was lost after the job had ended"
            notes = (*notes, lost)
        sha256: dict[str, str] | None = None
        if self._merge.slices:
            results, sha256 = self._results.write(self._merge, self._judge)
            spp = self._merge.spp
        else:  # what was last shown of its slices, if anything
            results, spp = self._jobs.results(job.id) if self._is_seen() else "", job.spp
        self._owners.conclude(self.owned, spp=spp, results=results, sha256=sha256, notes=notes)

    def _clear(self, job: Job, sums: set[str]) -> None:
        """Remove every blob of the job but its results, its sums and the slices that it keeps."""
        kept = self._slices_to_keep(job)
        results = self._jobs.results(job.id)
        self._blobs.delete(
            *(name for name in self._blobs.names(blobs.partials(job.id)) if name not in kept),
            *(name for name in self._blobs.names(blobs.checkpoints(job.id)) if name not in sums),
            *(
                name
                for name in self._blobs.names(blobs.results(job.id))
                if not name.startswith(f"{results}/")
            ),
        )

    def _slices_to_keep(self, job: Job) -> set[str]:
        """The partials of every slice in the ledger, where the job keeps its slices."""
        if not self._spec.keep_slices:
            return set()
        return {record["blob"] for record in self._jobs.ledger(job.id).values()}

    def _merge_up_to(self, job: Job) -> bool:
        """Merge what belongs to the final image but was not merged before the job ended.

        A converged job's image is the one that was judged, and a failed one's is what was merged
        of it, by whichever monitor: what could be merged once can be again. Any other takes every
        sample that was rendered. Returns False where a partial was lost.
        """
        merged_spp = max(job.spp, job.image_spp or 0)  # it may have been shown before it was judged
        last = {
            JobState.CONVERGED: job.spp // self._spec.slice_spp,
            JobState.FAILED: max(self._merge.slices, merged_spp // self._spec.slice_spp),
        }.get(job.state, self._spec.max_slices)
        while self._merge.slices < last:
            stop = min(self._merge.slices + _BATCH, last)
            records = self._owners.committed(job.id, range(self._merge.slices, stop))
            if not records:
                return True
            for record in records:
                if not self._add(record):
                    return False
                if self._spec.evaluates_at(self._merge.spp) and self._merge.spp <= job.spp:
                    with self._work.evaluations.timed():
                        self._judge.judge(self._merge)  # what the curve has already
        return True
