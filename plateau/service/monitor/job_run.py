"""One job of a monitor: takes the steps that `decisions` chooses."""

import logging
import time
from collections import deque
from dataclasses import replace
from typing import Any

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.read_ahead import ReadAhead
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Ownership, Ownerships
from plateau.farm.ledger.queue import SliceRecord
from plateau.farm.model.errors import FenceLost, IllegalTransition
from plateau.farm.model.fit import Crew
from plateau.farm.model.job import Job
from plateau.farm.model.shot import FrameWait
from plateau.farm.model.slices.rounds import Round
from plateau.farm.model.states import JobState
from plateau.picture.checkpoints import Checkpoints
from plateau.picture.denoised import Denoised
from plateau.picture.denoising.process import Denoising
from plateau.picture.films import Films
from plateau.picture.judge import Judge
from plateau.picture.result_files import flaw_of
from plateau.service.monitor import steps
from plateau.service.monitor.decisions import last_step, next_step
from plateau.service.monitor.job_image import JobImage
from plateau.service.monitor.known import Known, RuleAnswer
from plateau.service.monitor.look_ahead import LookAhead, enough
from plateau.service.monitor.result_sets import ResultSets

_LOG = logging.getLogger(__name__)


class JobRun:
    """The progress of one job. `advance` may be called at any time, also after any error.

    Slices are merged in order. So a monitor that takes over starts from the last checkpoint and
    reaches the same points, whatever has failed before.
    """

    def __init__(
        self,
        owned: Ownership,
        job: Job,
        jobs: Jobs,
        owners: Ownerships,
        store: Blobs,
        ahead: ReadAhead,
        denoising: Denoising,
        *,
        keeps_sums: bool,
    ) -> None:
        self.owned = owned
        self._jobs = jobs
        self._owners = owners
        self._blobs = store
        self._keeps_sums = keeps_sums
        self._image = JobImage(job.id, is_denoised=job.spec.is_denoised, denoising=denoising)
        self._judge = Judge(job.spec)
        self._point: dict[str, Any] = {}  # the last judgement's
        self._in_hand: deque[SliceRecord] = deque()  # committed and not yet merged
        self._decided: Round | None = None  # by the image that was judged last
        self._ahead = ahead
        self._checkpoints = Checkpoints(owned, owners, store, keep_slices=job.spec.keep_slices)
        self._begin(job)

    def _begin(self, job: Job) -> None:
        """Begin with what is left of the job; anew once its variant has decided the allocation."""
        self._films = Films(self.owned, self._owners, self._blobs, self._ahead, job.spec)
        self._results = ResultSets(self.owned, self._owners, self._blobs, job.spec)
        self._merge = self._checkpoints.recover(job.spec, self._judge)
        recovered = self._merge.slices
        self._known = Known(
            job=job,
            plan=self._jobs.plan(job),
            ahead=LookAhead.of(job),
            keeps_sums=self._keeps_sums,
            merged=recovered,
            judged=recovered,
            saved=recovered,
            saved_at_s=time.monotonic(),
            shown_spp=job.image_spp or 0,
        ).with_wait()

    @property
    def has_sums(self) -> bool:
        """Whether it holds the sums of slices."""
        return self._known.merged > 0

    @property
    def waits_for_shot(self) -> bool:
        """Whether all that it knows is in its checkpoint, with which it waits for a look."""
        return self._known.is_held and self._known.is_waiting

    def advance(self, job: Job, crew: Crew) -> bool:
        """Do everything that can be done now with the job as it is; returns whether it is finished.

        Raises `FenceLost` if another monitor owns the job, `StoreUnavailable` to be called again
        later, and `CorruptPartial` or `ValueError` if a slice can never be merged.
        """
        if job.spec.allocation != self._known.job.spec.allocation:
            self._begin(job)
        self._known = self._known.turn(job, enough(crew.fitting(job)), time.monotonic())
        try:
            while not isinstance(step := next_step(self._known), steps.Wait):
                self._known = self._after(step)
                if isinstance(step, steps.FinishJob):
                    return True
        finally:
            self._films.let_go()
        return False

    def _after(self, step: steps.Step) -> Known:
        """Take the step; returns what is known afterwards."""
        known = self._known
        match step:
            case steps.PlanSlices(stop, expected_spp):
                self._owners.plan(self.owned, range(known.merged, stop), expected_spp)
                return replace(known, planned=stop)
            case steps.ReadLedger(slices):
                self._in_hand = deque(self._owners.committed(self.owned.job_id, slices))
                self._films.expect(self._in_hand)
                if self._in_hand and not known.plan.pixels:
                    job = self._jobs.get(self.owned.job_id)
                    known = known.with_film(job.width, job.height)
                return known.with_slices(len(self._in_hand), len(slices))
            case steps.MergeSlice():
                return self._merge_slice()
            case steps.DenoiseImage():
                return known.with_denoised(is_done=self._image.denoise(self._merge, known))
            case steps.JudgeImage():
                return self._judge_image()
            case steps.RecordPoint():
                return self._record_point()
            case steps.ShowAndSave(show, save):
                return self._show_and_save(show=show, save=save)
            case steps.HoldFrame():
                return self._hold()
            case steps.ShowFirstSlice():
                self._show(known)
                return replace(known, shown_spp=known.spp)
            case steps.ShowGlimpse():
                return known.with_glimpse(self._results.show_glimpse(known.job, self._judge))
            case steps.ReadClock():
                job = self._jobs.get(self.owned.job_id)
                return known.with_time(job, self._jobs.now_ms() / 1000)
            case steps.InspectImage():
                return replace(known, flaw=flaw_of(self._merge.image()) or "")
            case steps.EndJob():
                self._end(step)
                return known.read_again(self._jobs.get(self.owned.job_id))
            case steps.ReadConclusion():
                return replace(known, concluded=self._owners.concluded(self.owned.job_id))
            case steps.ConcludeJob():
                self._conclude(step)
                return replace(known, concluded=True)
            case steps.FinishJob(keeps_sums):
                self._finish(keeps_sums=keeps_sums)
        return known

    def _merge_slice(self) -> Known:
        """Merge the next slice, unless its partial is lost or damaged."""
        record = self._in_hand.popleft()
        partial = self._films.partial(record, self._known.plan)
        if partial is None:
            return self._known.with_slice_lost()
        self._merge.add_partial(partial)
        self._checkpoints.note(record.blob)
        return self._known.with_slice_merged()

    def _judge_image(self) -> Known:
        denoised = self._image.of(self._merge)
        judgement = self._judge.judge(self._merge, self._known.plan, denoised=denoised)
        self._point, self._decided = judgement.point, judgement.decided
        verdict = judgement.verdict
        return self._known.with_answer(
            RuleAnswer(
                stop=verdict.stop,
                reason=verdict.reason,
                numbers=verdict.numbers,
                flaw=judgement.flaw,
                expected_spp=judgement.expected_spp,
            ),
            time.monotonic(),
        )

    def _record_point(self) -> Known:
        """Append the point to the curve, with the round that its image decides, if any."""
        known = self._known
        decided = self._decided if known.plan.decides(known.merged) else None
        self._owners.append_point(
            self.owned, known.spp, self._point, decided, is_last=known.is_last
        )
        return known.with_point(decided, self._point["expected_spp"])

    def _show_and_save(self, *, show: bool, save: bool, waits: FrameWait | None = None) -> Known:
        known = self._known
        if show:
            began_s = time.monotonic()
            self._show(known, self._image.of(self._merge))
            now_s = time.monotonic()
            known = self._known = replace(
                known, shown_spp=known.spp, shown_at_s=now_s, shown_in_s=now_s - began_s
            )
        if save:
            self._checkpoints.save(self._merge, self._judge, waits)
            known = replace(known, saved=known.merged, saved_at_s=time.monotonic())
        return replace(known, answer=None)

    def _hold(self) -> Known:
        """Show the image and save the sums, with which the frame waits for a look at its shot."""
        known, answer = self._known, self._known.answer
        assert answer is not None
        waits = FrameWait(
            spp=known.spp,
            stop=answer.stop,
            reason=answer.reason,
            numbers=answer.numbers,
        )
        known = self._show_and_save(show=known.spp != known.shown_spp, save=True, waits=waits)
        return replace(known, answer=answer).read_again(self._jobs.get(self.owned.job_id))

    def _show(self, known: Known, denoised: Denoised | None = None) -> None:
        is_point = known.plan.is_point(known.merged)
        self._results.show(known.job, self._merge, self._judge, denoised, is_point=is_point)

    def _end(self, step: steps.EndJob) -> None:
        """End the job, atomically with the final image if the step says so."""
        results, sha256, notes = "", None, None
        if step.with_image:
            results, sha256 = self._write(step.state, step.reason)
            notes = self._notes()
        try:
            self._owners.end(
                self.owned,
                step.state,
                step.ended_by,
                step.reason,
                step.numbers,
                results,
                sha256,
                notes,
            )
        except IllegalTransition as refused:
            _LOG.info("%s", refused)  # it has just been cancelled, or failed

    def _conclude(self, step: steps.ConcludeJob) -> None:
        results, sha256 = "", None
        notes: tuple[str, ...] | None = None
        spp_range = None
        if step.image == "merged":
            results, sha256 = self._write(self._known.job.state, self._known.job.reason)
            notes, spp_range = self._notes(step.notes), self._merge.spp_range
        elif step.image == "shown":
            results = self._jobs.results(self.owned.job_id)
        self._owners.conclude(
            self.owned,
            spp=step.spp,
            results=results,
            sha256=sha256,
            notes=notes or step.notes,
            spp_range=spp_range,
        )

    def _write(self, state: JobState, reason: str) -> tuple[str, dict[str, str]]:
        return self._results.write(
            self._known.job,
            self._merge,
            self._judge,
            self._image.of(self._merge),
            state=state,
            reason=reason,
        )

    def _notes(self, notes: tuple[str, ...] | None = None) -> tuple[str, ...] | None:
        """The job's notes with what the image adds to them; None if it adds nothing."""
        added = []
        if non_finite := self._merge.non_finite():
            added.append(f"image.exr has values that are NaN or infinite: {non_finite}")
        if len(kinds := self._merge.kinds) > 1:
            added.append(f"workers of {len(kinds)} kinds rendered the image: {', '.join(kinds)}")
        if not added:
            return None
        if notes is None:  # read again: the first slice may have added some in this turn
            notes = self._jobs.get(self.owned.job_id).notes
        return tuple(dict.fromkeys((*notes, *added)))

    def _finish(self, *, keeps_sums: bool) -> None:
        # Read again: another monitor may have saved one while this one was suspended.
        last = self._owners.checkpoint(self.owned.job_id) if keeps_sums else None
        self._clear(set() if last is None else {last.blob})
        self._owners.finish(self.owned, keeps_sums=last is not None)

    def _clear(self, sums: set[str]) -> None:
        """Delete the job's blobs except its results, these sums and its kept slices."""
        job_id, kept = self.owned.job_id, set()
        if self._known.job.spec.keep_slices:
            kept = {record["blob"] for record in self._jobs.ledger(job_id).values()}
        results = self._jobs.results(job_id)
        names = self._blobs.names
        self._blobs.delete(
            *(name for name in names(blobs.partials(job_id)) if name not in kept),
            *(name for name in names(blobs.checkpoints(job_id)) if name not in sums),
            *(name for name in names(blobs.results(job_id)) if not name.startswith(f"{results}/")),
        )


def give_up(owned: Ownership, owners: Ownerships, reason: str) -> bool:
    """Take the last step with a job that cannot continue; returns whether the job is finished."""
    try:
        match last_step(owners.state(owned.job_id), reason):
            case steps.AbandonJob():
                owners.abandon(owned)
                _LOG.error("Redis has lost the job, so the monitor gives it up")
            case steps.FinishJob(keeps_sums):
                owners.finish(owned, keeps_sums=keeps_sums)
            case steps.EndJob(state, ended_by, reason):
                owners.end(owned, state, ended_by, reason)
                return False
    except FenceLost as lost:  # as that of a job that was deleted meanwhile
        _LOG.warning("%s", lost)
    except IllegalTransition as refused:
        _LOG.info("%s", refused)  # it has just been cancelled
        return False
    return True
