"""What a monitor does next: row by row of its tables, and whatever happens to a job."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime, timezone

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plateau.farm.model.job import Job
from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.service.monitor import steps
from plateau.service.monitor.decisions import BATCH, ENDED, OPEN, Row, last_step, next_step
from plateau.service.monitor.known import Known, Ledger, RuleAnswer
from tests.service.monitor.decided_job import (
    DecidedJob,
    DecidingMonitor,
    Fault,
    Fenced,
    Rules,
    known,
    made_job,
    points_of,
)
from tests.support.long_tests import WANTED

NO_STOP = RuleAnswer(stop=False, reason="too noisy", numbers={}, flaw=None, expected_spp=None)
STOP = replace(NO_STOP, stop=True, reason="levelled off", numbers={"slope": 0.0})
BROKEN = replace(STOP, flaw="3 pixels are NaN")
READ = Ledger.READ
LATE = datetime.fromtimestamp(1000, timezone.utc)


def ended(state: JobState = JobState.CANCELLED, **fields: object) -> Known:
    job = made_job(state=state, spp=fields.pop("spp", 0), image_spp=fields.pop("image_spp", None))
    return known(job=job, **fields)


def ended_denoised(spp: int = 0, **fields: object) -> Known:
    spec = {"denoise": {"name": "oidn"}}
    return known(job=made_job(state=JobState.CANCELLED, spp=spp, spec=spec), **fields)


def limited(**fields: object) -> Known:
    """A job that is to take no longer than 10 s, and has nothing else to do."""
    return known(
        job=made_job(spec={"time_limit_s": 10}), ledger=READ, sought_glimpse=True, **fields
    )


#: A point of the curve at 100 spp, whose answer is known.
POINT = known(merged=4, judged=4, saved=4, shown_spp=100, answer=NO_STOP)
RECORDED = replace(POINT, recorded=True)
AT_THE_CAP = replace(
    RECORDED,
    job=made_job(spec={"max_spp": 100}),
    plan=Plan.of(JobSpec(max_spp=100, allocation="frame")),
)


def frame(spec: dict[str, object] | None = None, **stands: object) -> Job:
    """A frame of a shot, and how it stands there."""
    return made_job(spec=spec or {}, in_shot={"id": "0" * 12, **stands})


#: What a look at a shot says of a frame with an image of 100 spp.
ASKED = {"spp": 100, "needs_spp": 200, "good": True, "words": "the shot is noisy"}
MAY_END = {"spp": 100, "needs_spp": None, "good": True, "words": "the shot is good"}
WAITS = {"spp": 100, "stop": True, "reason": "levelled off", "numbers": {}}

#: One that may end, of which another monitor has the sums with which it waited, and no more.
RESTORED = replace(
    RECORDED, answer=STOP, job=frame({"denoise": {"name": "oidn"}}, waits=WAITS, answer=MAY_END)
)

#: A job whose image is denoised.
DENOISED = known(job=made_job(spec={"denoise": {"name": "oidn"}}), merged=4)

CONVERGED = steps.EndJob(JobState.CONVERGED, "rule", "levelled off", {"slope": 0.0}, True)
GOOD = replace(CONVERGED, reason="levelled off; the shot is good")
NOTHING = steps.ShowAndSave(False, False)

#: What is known, and what is done then: a case at least for each row of each table.
CASES: list[tuple[Known, steps.Step]] = [
    (known(planned=-1, enough=3), steps.PlanSlices(3, 200)),
    (POINT, steps.RecordPoint()),
    (
        replace(RECORDED, answer=BROKEN),
        steps.EndJob(JobState.FAILED, "image", "3 pixels are NaN", None, True),
    ),
    (replace(RECORDED, answer=STOP), CONVERGED),
    (replace(AT_THE_CAP, answer=STOP), CONVERGED),
    (
        AT_THE_CAP,
        steps.EndJob(
            JobState.EXHAUSTED, "cap", "reached the cap of 100 spp; too noisy", None, True
        ),
    ),
    # A frame waits for a look at its shot before it ends, by its rule or at its cap
    (replace(RECORDED, answer=STOP, job=frame()), steps.HoldFrame()),
    (replace(AT_THE_CAP, job=frame({"max_spp": 100})), steps.HoldFrame()),
    (replace(RECORDED, answer=STOP, job=frame(waits=WAITS), saved=3), steps.HoldFrame()),
    (replace(RECORDED, answer=STOP, job=frame(waits=WAITS), planned=-1), steps.Wait()),
    (replace(RECORDED, answer=STOP, job=frame(waits=WAITS, answer=ASKED)), NOTHING),
    (replace(RECORDED, answer=STOP, job=frame(waits=WAITS, answer=MAY_END)), GOOD),
    # Its sums were lost after that, and it does not end with fewer
    (replace(RECORDED, answer=STOP, job=frame(answer={**MAY_END, "spp": 200})), NOTHING),
    (
        replace(
            AT_THE_CAP,
            answer=STOP,
            job=frame({"max_spp": 100}, waits=WAITS, answer={**MAY_END, "good": False}),
        ),
        steps.EndJob(
            JobState.EXHAUSTED,
            "cap",
            "reached the cap of 100 spp; levelled off; the shot is good",
            None,
            True,
        ),
    ),
    # Its image is denoised anew by a monitor that has read its sums
    (RESTORED, steps.DenoiseImage()),
    (replace(RESTORED, is_being_denoised=True), steps.Wait()),
    (replace(RESTORED, denoised=RECORDED.merged), GOOD),
    # The job that this one continues had been stopped there already
    (replace(RECORDED, answer=STOP, job=made_job(continued_spp=100)), NOTHING),
    (RECORDED, NOTHING),
    (replace(RECORDED, shown_spp=0, saved=0), steps.ShowAndSave(True, False)),
    (replace(RECORDED, shown_spp=0, shown_at_s=-1.9), NOTHING),
    # Images that take long come less often, but for a limit
    (replace(RECORDED, shown_spp=0, shown_at_s=-4.9, shown_in_s=0.1), NOTHING),
    (
        replace(RECORDED, shown_spp=0, shown_at_s=-10.1, shown_in_s=0.3),
        steps.ShowAndSave(True, False),
    ),
    (replace(RECORDED, merged=8, judged=8, saved=3, at_s=9.0), steps.ShowAndSave(True, True)),
    (
        replace(RECORDED, merged=8, judged=8, saved=3, saved_at_s=-4.9),
        steps.ShowAndSave(True, False),
    ),
    (known(merged=4, judged=0, in_hand=2), steps.JudgeImage()),
    (DENOISED, steps.DenoiseImage()),
    (replace(DENOISED, is_being_denoised=True, in_hand=2), steps.Wait()),
    (replace(DENOISED, denoised=4), steps.JudgeImage()),
    (
        replace(DENOISED, denoised=4, judged=4, merged=5, ledger=READ, at_s=99.0, planned=99),
        steps.Wait(),
    ),
    (known(merged=1), steps.ShowFirstSlice()),
    (known(merged=1, in_hand=3, shown_spp=25), steps.MergeSlice(1)),
    (known(merged=1, job=made_job(image_spp=25)), steps.ReadLedger(range(1, 1 + BATCH))),
    (known(merged=3, in_hand=2), steps.MergeSlice(3)),
    (known(merged=3, ledger=Ledger.PARTLY_READ), steps.ReadLedger(range(3, 3 + BATCH))),
    (known(ledger=READ), steps.ShowGlimpse()),
    (known(ledger=READ, sought_glimpse=True), steps.Wait()),
    (known(ledger=READ, job=made_job(state=JobState.QUEUED)), steps.Wait()),
    (limited(), steps.ReadClock()),
    (limited(redis_s=10.0), steps.Wait()),
    (
        limited(redis_s=10.1),
        steps.EndJob(
            JobState.FAILED,
            "time_limit",
            "no slice of it was rendered within its time limit of 10 s",
        ),
    ),
    (limited(redis_s=10.1, merged=3), steps.InspectImage()),
    (
        limited(redis_s=10.1, merged=3, flaw=""),
        steps.EndJob(JobState.EXHAUSTED, "time_limit", "reached its time limit of 10 s at 75 spp"),
    ),
    (
        limited(redis_s=10.1, merged=3, flaw="2 are NaN"),
        steps.EndJob(
            JobState.FAILED, "image", "reached its time limit of 10 s at 75 spp; 2 are NaN"
        ),
    ),
    (replace(limited(), job=made_job(spec={"time_limit_s": 10}, started_at=None)), steps.Wait()),
    (
        replace(
            limited(redis_s=1015.0),
            job=made_job(spec={"time_limit_s": 10}, started_at=LATE, paused_s=5),
        ),
        steps.Wait(),
    ),
    (known(ledger=READ, merged=3, planned=5, enough=3), steps.PlanSlices(6, 200)),
    (known(ledger=READ, merged=3, planned=6, enough=3), steps.Wait()),
    # Workers were faster than the monitor
    (known(planned=7, awaited=7, merged=6, enough=1).with_slices(1, 16), steps.PlanSlices(8, 200)),
    (known(planned=6, awaited=6, merged=3, enough=3).with_slices(2, 16), steps.MergeSlice(3)),
    # Where many are planned, they are not planned one by one
    (
        known(ledger=READ, merged=3, planned=43, enough=45, ahead=known().ahead.expecting(None)),
        steps.Wait(),
    ),
    (
        known(ledger=READ, merged=3, job=made_job(state=JobState.PAUSED)),
        steps.ShowAndSave(True, True),
    ),
    (
        known(ledger=READ, merged=3, saved=3, shown_spp=75, job=made_job(state=JobState.PAUSED)),
        steps.Wait(),
    ),
    # The image of a point that came too soon after another's is shown though no slice comes
    (
        replace(RECORDED, answer=None, ledger=READ, shown_spp=75, shown_at_s=-2.1),
        steps.ShowAndSave(True, False),
    ),
    (replace(RECORDED, answer=None, ledger=READ, shown_spp=75, shown_at_s=-1.9), steps.Wait()),
    (ended(), steps.ReadConclusion()),
    (ended(merged=4, spp=100, concluded=False), steps.JudgeImage()),
    (ended_denoised(merged=4, spp=100, concluded=False), steps.DenoiseImage()),
    (ended_denoised(merged=4, is_being_denoised=True, concluded=False), steps.Wait()),
    (ended_denoised(merged=4, spp=100, denoised=4, concluded=False), steps.JudgeImage()),
    (ended_denoised(merged=3, ledger=READ, concluded=False), steps.DenoiseImage()),
    (ended_denoised(merged=1, ledger=READ, concluded=False), steps.ConcludeJob("merged", 25, ())),
    (ended(merged=4, judged=4, concluded=False, in_hand=1), steps.MergeSlice(4)),
    # It was cancelled while a point of its curve was due
    (ended(merged=4, spp=75, concluded=False, in_hand=1), steps.JudgeImage()),
    (ended(merged=4, judged=4, spp=75, answer=NO_STOP, concluded=False), steps.RecordPoint()),
    (ended(concluded=False), steps.ReadLedger(range(BATCH))),
    (ended(JobState.CONVERGED, spp=100, concluded=False), steps.ReadLedger(range(4))),
    (ended(JobState.FAILED, image_spp=25, concluded=False), steps.ReadLedger(range(1))),
    (ended(ledger=READ, concluded=False), steps.ConcludeJob("none", 0, ())),
    (ended(ledger=READ, concluded=False, image_spp=25, spp=25), steps.ConcludeJob("shown", 25, ())),
    # Its image was shown before its curve began
    (ended(ledger=READ, concluded=False, image_spp=25), steps.ConcludeJob("shown", 25, ())),
    (ended(ledger=READ, merged=3, concluded=False), steps.ConcludeJob("merged", 75, ())),
    (
        ended(ledger=READ, merged=3, lost=True, concluded=False),
        steps.ConcludeJob(
            "merged", 75, ("the image has 75 spp: a slice was lost after the job had ended",)
        ),
    ),
    # Its curve goes farther, and the slice that was lost is rendered no more
    (
        ended(ledger=READ, merged=3, spp=100, concluded=False),
        steps.ConcludeJob(
            "merged",
            75,
            ("the image has 75 spp: a slice was lost and not rendered again before the end",),
        ),
    ),
    (ended(ledger=READ, merged=3, concluded=True), steps.ShowAndSave(False, True)),
    (ended(ledger=READ, merged=3, saved=3, concluded=True), steps.FinishJob(True)),
    (ended(merged=3, keeps_sums=False, concluded=True), steps.FinishJob(False)),
]


@pytest.mark.parametrize(("what", "then"), CASES)
def test_what_is_done_next(what: Known, then: steps.Step) -> None:
    assert next_step(what) == then


def test_each_row_has_a_case() -> None:
    def row(what: Known) -> Row:
        table = ENDED if what.job.state.ended else OPEN
        return next(row for row in table if row.applies(what))

    found = {row(what).when for what, _ in CASES}
    assert {row.when for row in (*OPEN, *ENDED)} == found


@pytest.mark.parametrize("state", [None, *JobState])
def test_a_job_that_cannot_go_on_ends_once(state: JobState | None) -> None:
    step = last_step(state, "the merge cannot go on")
    if state is None:
        assert step == steps.AbandonJob()
    elif state.ended:
        assert step == steps.FinishJob(keeps_sums=False)
    else:
        assert step == steps.EndJob(JobState.FAILED, "farm", "the merge cannot go on")


def test_what_was_seen_of_an_image_does_not_hold_of_the_next() -> None:
    assert known(merged=3, in_hand=1, flaw="").with_slice_merged().flaw is None


# Whatever happens.


@dataclass(frozen=True)
class Story:
    """A job, and what happens to it."""

    job: Callable[[], DecidedJob]
    enough: int
    events: list[tuple[str, int]]


WORK = ["commit"] * 8 + ["turn"] * 4 + ["time_passes", "turn and time_passes", "turn and commit"]
TROUBLE = ["fault", "take_over", "lose_checkpoint", "spoil", "pause", "resume", "turn and pause"]
ENDS = ["cancel", "fail", "turn and cancel", "turn and fail"]


@st.composite
def stories(draw: st.DrawFn, events: list[str], *, limited: bool = False) -> Story:
    slice_spp, keep_slices = draw(st.sampled_from([5, 10])), draw(st.booleans())
    denoise = draw(st.sampled_from(["none", "none", "oidn"]))
    if denoise == "none":
        step, cap = slice_spp * draw(st.integers(1, 4)), draw(st.integers(1, 24))
    else:
        step, cap = 4 * slice_spp, 4 * draw(st.integers(1, 12))
    taken_spp = 0 if keep_slices else slice_spp * draw(st.integers(0, cap - 1))
    most = cap * slice_spp
    ahead = draw(st.none() | st.integers(1, 2 * most))
    rules = Rules(
        stop_spp=draw(st.none() | st.integers(1, 2 * most)),
        flaw_spp=draw(st.none() | st.integers(taken_spp + 1, 2 * most)),
        expected=lambda spp: ahead and max(ahead, spp - step),
    )
    spec = JobSpec(
        step=step,
        slice_spp=slice_spp,
        max_spp=most,
        denoise={"name": denoise},
        rule={"name": draw(st.sampled_from(["reverse", "visible"]))},
        keep_slices=keep_slices,
        time_limit_s=draw(st.none() | st.integers(1, 20)) if limited else None,
        time_limit_from=draw(st.sampled_from(["first_slice", "submission"])),
    )
    keeps_sums = draw(st.booleans())
    happened = st.tuples(st.sampled_from(events), st.integers(0, 1000))
    return Story(
        lambda: DecidedJob(spec, rules, keeps_sums, continued_spp=taken_spp),
        enough=2 * draw(st.integers(1, 4)) + 1,
        events=draw(st.lists(happened, min_size=20, max_size=80)),
    )


def happen(story: Story) -> DecidedJob:
    """Have all of it happen; every step asserts what has to hold of it."""
    job = story.job()
    monitor = DecidingMonitor(job, story.enough)
    for what, number in story.events:
        before = job.state, job.reason
        if what == "turn":
            monitor.turn()
        elif what == "fault":
            with suppress(Fault):
                monitor.turn(number // 2 % 10, before=number % 2 == 0)
        elif what in {"take_over", "lose_checkpoint"} and not job.finished:
            if what == "lose_checkpoint":  # a monitor reads it as it takes over
                job.lose_checkpoint(number)
            zombie, monitor = monitor, DecidingMonitor(job, story.enough)
            was = repr(job)
            with suppress(Fenced):
                zombie.turn()
            assert repr(job) == was
        elif what.startswith("turn and "):
            happens = getattr(job, what.removeprefix("turn and "))
            monitor.turn(meanwhile=lambda at, n=number, it=happens: it(n) if at == n % 10 else None)
        elif what not in {"take_over", "lose_checkpoint"}:
            getattr(job, what)(number)
        if before[0].ended:  # an end is final
            assert (job.state, job.reason) == before
    # At last it is left alone, until it has finished
    for number in range(2000):
        if job.finished:
            return job
        job.resume(0)
        job.commit(number)
        monitor.turn()
    raise AssertionError(f"the job is {job.state.value} for good")


MANY = settings(max_examples=2000 if WANTED else 60, deadline=None)


@MANY
@given(stories([*WORK, *TROUBLE, *ENDS], limited=True))
def test_whatever_happens_a_job_comes_to_one_end(story: Story) -> None:
    job = happen(story)
    # The curve has each point once, from the first on
    points = points_of(job.spec, job.spec.max_spp)
    assert job.curve == points[: len(job.curve)]
    assert job.state.ended
    if job.state in {JobState.CONVERGED, JobState.EXHAUSTED}:
        assert job.image_spp == job.spp
    if not job.notes and not job.lost_sums:  # else what was rendered has been lost since
        assert job.spp >= max(job.curve, default=0)


@MANY
@given(stories([*WORK, *TROUBLE]))
def test_trouble_changes_nothing_of_what_a_user_gets(story: Story) -> None:
    undisturbed = happen(replace(story, events=[]))
    job = happen(story)
    assert (job.state, job.reason, job.curve) == (
        undisturbed.state,
        undisturbed.reason,
        undisturbed.curve,
    )
    assert (job.spp, job.image_spp) == (undisturbed.spp, undisturbed.image_spp)
    # And its sums are there to continue from, where they are kept
    if job.keeps_sums and not job.spec.keep_slices and not job.lost_sums:
        assert job.checkpoint.slices * job.spec.slice_spp == job.spp
