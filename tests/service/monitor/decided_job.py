"""A job of which everything but the decisions is made up: Redis, blobs, workers, rules and time.

The monitor's decisions and what it knows are the real ones. The rest does what the farm's scripts
and a blob store would, in memory, and asserts at each step what has to hold of any job.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from typing import Any

from plateau.farm.model.job import Job
from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JOB_MOVES, JobState
from plateau.service.monitor import steps
from plateau.service.monitor.decisions import next_step
from plateau.service.monitor.known import Known, RuleAnswer
from plateau.service.monitor.look_ahead import LookAhead
from tests.support import FRAMES

EPOCH = datetime.fromtimestamp(0, timezone.utc)


def made_job(**fields: Any) -> Job:
    """A job, rendering since 1970, with these fields; those of its spec under `spec`."""
    given = fields.pop("spec", {})
    spec = given if isinstance(given, JobSpec) else JobSpec.model_validate(FRAMES | given)
    usual: dict[str, Any] = {
        "id": "0" * 12,
        "name": "box",
        "state": JobState.RENDERING,
        "outcome": "rendering",
        "reason": "rendering",
        "spec": spec,
        "scene_sha256": "0" * 64,
        "variant": None,
        "width": 32,
        "height": 24,
        "spp": 0,
        "committed_spp": 0,
        "points": 0,
        "machine_s": 0.0,
        "created_at": EPOCH,
        "started_at": EPOCH,
    }
    return Job.model_validate({**usual, **fields})


def points_of(spec: JobSpec, spp: int) -> list[int]:
    """The spp of the points of a curve, up to this one."""
    if spec.is_denoised:
        plan, points = Plan.of(spec), []
        for at in range(1, spp // spec.slice_spp + 1):
            if plan.is_point(at):
                points.append(at * spec.slice_spp)
                plan = plan.with_point(at, None)
        return points
    return [at for at in range(1, spp + 1) if at % spec.step == 0 or at == spec.max_spp]


def known(**fields: Any) -> Known:
    """What a monitor knows of a job; all that it can plan is planned, unless a field says more."""
    job = fields.pop("job", None) or made_job()
    usual: dict[str, Any] = {"ahead": LookAhead.of(job), "keeps_sums": True, "planned": 10**6}
    usual["plan"] = Plan.of(job.spec, job.width, job.height)
    return Known(job=job, **{**usual, **fields})


class Fault(Exception):
    """Redis or the blob store was away, or the monitor died."""


class Fenced(Exception):
    """Another monitor owns the job."""


@dataclass(frozen=True)
class Rules:
    """What the rules say of the image at some spp: the same whoever asks."""

    stop_spp: int | None = None  #: the job's own rule is satisfied from there on
    flaw_spp: int | None = None  #: the image is broken from there on
    expected: Callable[[int], int | None] = lambda spp: None

    def answer(self, spp: int) -> RuleAnswer:
        return RuleAnswer(
            stop=self.stop_spp is not None and spp >= self.stop_spp,
            reason=f"judged at {spp} spp",
            numbers={"spp": spp},
            flaw=self.flaw(spp),
            expected_spp=self.expected(spp),
        )

    def flaw(self, spp: int) -> str | None:
        broken = self.flaw_spp is not None and spp >= self.flaw_spp
        return f"broken from {self.flaw_spp} spp on" if broken else None


@dataclass(frozen=True)
class Checkpoint:
    """Sums, and which points of the curve the rules remember."""

    slices: int = 0
    judged: tuple[int, ...] = ()


@dataclass
class DecidedJob:
    """A job in a farm that is made up."""

    spec: JobSpec
    rules: Rules
    keeps_sums: bool = True
    state: JobState = JobState.QUEUED
    reason: str = ""
    planned: int = 0
    committed: set[int] = field(default_factory=set)
    partials: set[int] = field(default_factory=set)  #: that are stored, and whole
    curve: list[int] = field(default_factory=list)
    spp: int = 0
    image_spp: int | None = None
    notes: tuple[str, ...] = ()
    checkpoint: Checkpoint = Checkpoint()
    concluded: bool = False
    finished: bool = False
    clock_s: float = 0.0
    paused_s: float = 0.0
    started_s: float | None = None
    owner: int = 0
    continued_spp: int = 0
    lost_sums: bool = False  #: whether a checkpoint was lost

    def __post_init__(self) -> None:
        """Take over the sums and the curve of another job, where it continues one."""
        if self.continued_spp:
            slices = self.continued_spp // self.spec.slice_spp
            points = points_of(self.spec, self.continued_spp)
            self.state, self.planned, self.committed = (
                JobState.RENDERING,
                slices,
                set(range(slices)),
            )
            self.curve, self.spp = list(points), max(points, default=0)
            self.image_spp, self.started_s = self.continued_spp, 0.0
            self.checkpoint = Checkpoint(slices, tuple(points))

    def read(self) -> Job:
        started = self.started_s
        return made_job(
            spec=self.spec,
            state=self.state,
            spp=self.spp,
            points=len(self.curve),
            continued_spp=self.continued_spp,
            image_spp=self.image_spp,
            notes=self.notes,
            paused_s=self.paused_s,
            started_at=None if started is None else datetime.fromtimestamp(started, timezone.utc),
        )

    def move(self, state: JobState, reason: str) -> bool:
        """Move the job, where that is legal; an end withdraws what nobody has begun."""
        if state not in JOB_MOVES[self.state]:
            return False
        self.state, self.reason = state, reason
        return True

    # What workers and users do

    def commit(self, number: int) -> None:
        """Commit one of the slices that are planned, in any order."""
        waiting = sorted(set(range(self.planned)) - self.committed)
        if not waiting or self.state.ended or self.state is JobState.PAUSED:
            return
        if self.state is JobState.QUEUED:
            self.move(JobState.RENDERING, "rendering")
            self.started_s = self.clock_s
        index = waiting[number % len(waiting)]
        self.committed.add(index)
        self.partials.add(index)

    def spoil(self, number: int) -> None:
        """Lose a partial that no checkpoint has."""
        if self.partials:
            self.partials.remove(sorted(self.partials)[number % len(self.partials)])

    def lose_checkpoint(self, number: int) -> None:
        """Lose the sums: slices whose partials went when these had them are rendered again."""
        self.checkpoint, self.lost_sums = Checkpoint(), True
        if not self.state.ended:
            self.committed &= self.partials

    def pause(self, number: int) -> None:
        if self.state is JobState.RENDERING:
            self.move(JobState.PAUSED, "paused")

    def resume(self, number: int) -> None:
        if self.state is JobState.PAUSED:
            self.move(JobState.RENDERING, "resumed")

    def cancel(self, number: int) -> None:
        self.move(JobState.CANCELLED, "cancelled")

    def fail(self, number: int) -> None:
        self.move(JobState.FAILED, "no texture of that name")

    def time_passes(self, number: int) -> None:
        seconds = number % 50 / 10
        self.clock_s += seconds
        if self.state is JobState.PAUSED:
            self.paused_s += seconds


class DecidingMonitor:
    """A monitor that owns the job: it takes the steps that are decided on."""

    def __init__(self, job: DecidedJob, enough: int) -> None:
        self.job = job
        self.enough = enough
        job.owner += 1
        self.token = job.owner
        self.in_hand: list[int] = []
        self.sums = job.checkpoint.slices
        self.denoising = 0  #: slices in the image that it has had denoised
        self.judged = list(job.checkpoint.judged)
        read = job.read()
        self.known = Known(
            job=read,
            plan=Plan.of(
                read.spec, read.width, read.height, looks=[(spp, None) for spp in self.job.curve]
            ),
            ahead=LookAhead.of(read),
            keeps_sums=job.keeps_sums,
            merged=self.sums,
            judged=self.sums,
            saved=self.sums,
            saved_at_s=job.clock_s,
        )

    def turn(
        self,
        fault_at: int = -1,
        *,
        before: bool = True,
        meanwhile: Callable[[int], None] = lambda number: None,
    ) -> None:
        """Have a turn; at the step of this number something fails, before or after its effect.

        Before each step, something may happen to the job meanwhile.
        """
        self.known = self.known.turn(self.job.read(), self.enough, self.job.clock_s)
        for number in range(10_000):
            meanwhile(number)
            step = next_step(self.known)
            if isinstance(step, steps.Wait) or self.job.finished:
                return
            if number == fault_at and before:
                raise Fault
            after = self.take(step)
            # What is done in memory alone is known as soon as it is done
            if number == fault_at and not isinstance(step, steps.MergeSlice | steps.JudgeImage):
                raise Fault
            self.known = after
        raise AssertionError("a turn that has no end")

    def write(self) -> None:
        if self.token != self.job.owner:
            raise Fenced

    def take(self, step: steps.Step) -> Known:
        """Take the step, as `JobRun` would; assert that it may be taken."""
        job, spec, known = self.job, self.job.spec, self.known
        spp = self.sums * spec.slice_spp
        assert (known.merged, known.spp) == (self.sums, spp)
        match step:
            case steps.PlanSlices(stop, expected_spp):
                assert not known.job.state.ended
                ahead = self.enough * known.reach
                assert known.reach <= 8
                assert stop <= min(spec.max_spp // spec.slice_spp, self.sums + ahead)
                assert spp <= expected_spp <= spec.max_spp
                self.write()
                if not job.state.ended:
                    job.planned = max(job.planned, stop)
                return replace(known, planned=stop)
            case steps.ReadLedger(slices):
                assert slices.start == self.sums
                found = [index for index in slices if index in job.committed]
                self.in_hand = [one for at, one in enumerate(found, slices.start) if one == at]
                return known.with_slices(len(self.in_hand), len(slices))
            case steps.MergeSlice(index):
                return self._merge(index)
            case steps.DenoiseImage():
                assert spec.is_denoised
                assert self.sums > 1
                # It is done at the next turn
                asked, self.denoising = self.denoising, self.sums
                return known.with_denoised(is_done=asked == self.sums)
            case steps.JudgeImage():
                assert not spec.is_denoised or known.denoised == self.sums
                # The rules see each point of the curve once, in order, whoever judges
                assert [*self.judged, spp] == points_of(spec, spp)
                self.judged.append(spp)
                return known.with_answer(job.rules.answer(spp), job.clock_s)
            case steps.RecordPoint():
                assert self.judged[-1] == spp
                self.write()
                if not job.curve or job.curve[-1] < spp:
                    job.curve.append(spp)
                    job.spp = spp
                return known.with_point(None, None)
            case steps.ShowAndSave(show, save):
                return self._show_and_save(show=show, save=save)
            case steps.ShowFirstSlice():
                assert self.sums == 1
                self.write()
                job.image_spp = spp
                return replace(known, shown_spp=spp)
            case steps.ShowGlimpse():
                assert self.sums == 0
                return known.with_glimpse(None)
            case steps.ReadClock():
                return known.with_time(job.read(), job.clock_s)
            case steps.InspectImage():
                return replace(known, flaw=job.rules.flaw(spp) or "")
            case steps.EndJob():
                self._end(step)
                return known.read_again(job.read())
            case steps.ReadConclusion():
                return replace(known, concluded=job.concluded)
            case steps.ConcludeJob():
                self._conclude(step)
                return replace(known, concluded=True)
            case steps.FinishJob():
                assert job.state.ended
                assert job.concluded
                self.write()
                job.finished = True
                return known
            case steps.Wait():
                return known

    def _merge(self, index: int) -> Known:
        """Slices are merged in the order of their indices, each once."""
        job = self.job
        assert index == self.sums == self.in_hand.pop(0)
        if job.state is JobState.CONVERGED:
            assert (index + 1) * job.spec.slice_spp <= job.spp
        if index not in job.partials:
            if not job.state.ended:
                self.write()
                job.committed.discard(index)
            self.in_hand = []
            return self.known.with_slice_lost()
        self.sums += 1
        return self.known.with_slice_merged()

    def _show_and_save(self, *, show: bool, save: bool) -> Known:
        job, known = self.job, self.known
        spp = self.sums * job.spec.slice_spp
        assert self.sums > 0
        if show:
            self.write()
            job.image_spp = spp
            known = replace(known, shown_spp=spp, shown_at_s=job.clock_s)
        if save:
            # The rules have seen all points that it has, and so has the curve
            points = points_of(job.spec, spp)
            assert self.judged == points
            assert set(points) <= set(job.curve)
            self.write()
            job.checkpoint = Checkpoint(self.sums, tuple(self.judged))
            if not job.spec.keep_slices:
                job.partials -= set(range(self.sums))
            known = replace(known, saved=self.sums, saved_at_s=job.clock_s)
        return replace(known, answer=None)

    def _end(self, step: steps.EndJob) -> None:
        job, spp = self.job, self.sums * self.job.spec.slice_spp
        answer = job.rules.answer(spp)
        assert not self.known.job.state.ended
        assert step.state.ended
        assert step.reason
        if step.state is JobState.CONVERGED:
            assert answer.stop
            assert spp > job.continued_spp
            assert answer.flaw is None
            assert step.numbers == {"spp": spp}
        if step.with_image:  # it was judged, and the curve has it
            assert self.judged[-1] == spp == job.curve[-1]
        if step.state is JobState.EXHAUSTED:
            assert spp > 0
            assert answer.flaw is None
            assert spp == job.spec.max_spp or step.ended_by == "time_limit"
        self.write()
        if job.move(step.state, step.reason) and step.with_image:
            job.image_spp, job.concluded = spp, True

    def _conclude(self, step: steps.ConcludeJob) -> None:
        job, spp = self.job, self.sums * self.job.spec.slice_spp
        assert job.state.ended
        assert not job.concluded
        self.write()
        if step.image == "merged":
            assert step.spp == spp > 0
            # No sample that was rendered is left out, unless the rule did without it or it is lost
            next_one = self.sums in job.committed
            if next_one and job.state in {JobState.CANCELLED, JobState.EXHAUSTED}:
                assert "a slice was lost" in step.notes[-1]
            if not step.notes and not job.lost_sums:
                assert spp >= job.spp
        elif step.image == "shown":
            assert (job.image_spp or 0) >= job.spec.slice_spp
        job.spp, job.notes, job.concluded = step.spp, step.notes, True
        job.image_spp = {"merged": spp, "shown": job.image_spp, "none": None}[step.image]
