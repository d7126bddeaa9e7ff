"""The decision what a monitor does next with a job: from `Known` alone, without Redis or a clock.

It has two tables, one for jobs that have not ended and one for jobs that have. `next_step` reads
the table from the top and returns the step of the first row that applies. `JobRun` takes the step,
notes the outcome in `Known`, and asks again.

A step that fails is decided on again at the job's next turn. So every step may be taken twice.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from plateau.farm.model.states import JobState
from plateau.service.monitor.known import Known, Ledger, RuleAnswer
from plateau.service.monitor.steps import (
    AbandonJob,
    ConcludeJob,
    DenoiseImage,
    EndJob,
    FinalImage,
    FinishJob,
    HoldFrame,
    InspectImage,
    JudgeImage,
    MergeSlice,
    PlanSlices,
    ReadClock,
    ReadConclusion,
    ReadLedger,
    RecordPoint,
    ShowAndSave,
    ShowFirstSlice,
    ShowGlimpse,
    Step,
    Wait,
)

BATCH: Final = 16  #: records read from the ledger at once


@dataclass(frozen=True)
class Row:
    """A row of a table: when it applies, in words and in code, and the step to take."""

    when: str
    applies: Callable[[Known], bool]
    step: Step | Callable[[Known], Step]


def next_step(known: Known) -> Step:
    """The next step with the job."""
    table = ENDED if known.job.state.ended else OPEN
    step = next(row.step for row in table if row.applies(known))
    return step(known) if callable(step) else step


def last_step(state: JobState | None, reason: str) -> EndJob | FinishJob | AbandonJob:
    """The last step with a job that cannot continue.

    `state` is None if Redis has lost the job. A job that had ended stays without its last results.
    """
    if state is None:
        return AbandonJob()
    return FinishJob(keeps_sums=False) if state.ended else EndJob(JobState.FAILED, "farm", reason)


def _always(_: Known) -> bool:
    return True


# A job that has not ended: plan, judge, merge, look at the time, and plan again.


def _plan(known: Known) -> Step:
    return PlanSlices(known.stop, known.ahead.expected_end_spp(known.spp))


def _answer(known: Known) -> RuleAnswer:
    assert known.answer is not None
    return known.answer


def _reason(known: Known) -> str:
    frame = known.job.in_shot
    said = "" if frame is None or frame.answer is None else f"; {frame.answer.words}"
    return f"{_answer(known).reason}{said}"


def _is_short(known: Known) -> bool:
    """Whether its cap kept its shot from becoming good."""
    frame = known.job.in_shot
    is_good = frame is None or frame.answer is None or frame.answer.good
    return known.at_cap and not is_good


def _converge(known: Known) -> Step:
    answer = _answer(known)
    return EndJob(JobState.CONVERGED, "rule", _reason(known), answer.numbers, with_image=True)


def _reach_the_cap(known: Known) -> Step:
    reason = f"reached the cap of {known.job.spec.max_spp} spp; {_reason(known)}"
    return EndJob(JobState.EXHAUSTED, "cap", reason, with_image=True)


def _run_out(known: Known) -> Step:
    limit = f"its time limit of {known.job.spec.time_limit_s:g} s"
    if not known.merged:  # an exhausted job always has an image
        return EndJob(JobState.FAILED, "time_limit", f"no slice of it was rendered within {limit}")
    reason = f"reached {limit} at {known.spp} spp"
    if known.flaw:  # and the flaw is newer than the last point of the curve
        return EndJob(JobState.FAILED, "image", f"{reason}; {known.flaw}")
    return EndJob(JobState.EXHAUSTED, "time_limit", reason)


_A_POINT: Final = (
    Row(
        "the sums have reached a point of the curve, and their image is to be denoised",
        lambda known: known.is_to_be_judged and known.is_to_be_denoised,
        DenoiseImage(),
    ),
    Row("the sums have reached a point", lambda known: known.is_to_be_judged, JudgeImage()),
)

OPEN: Final = (
    Row(
        "a turn begins and workers may soon wait, or they wait",
        lambda known: (
            (known.ledger is Ledger.UNREAD or known.is_dry)
            and known.lacks_slices
            and not known.is_held
        ),
        _plan,
    ),
    # A point of the curve. Its answer stays known until all of this is done.
    Row(
        "the rules have answered, and the curve lacks the point",
        lambda known: known.answer is not None and not known.recorded,
        RecordPoint(),
    ),
    Row(
        "the image cannot be a result",
        lambda known: known.answer is not None and known.answer.flaw is not None,
        lambda known: EndJob(JobState.FAILED, "image", _answer(known).flaw or "", with_image=True),
    ),
    Row(
        "it would end, and a look at its shot has to come first",
        lambda known: known.is_held and not known.is_waiting,
        HoldFrame(),
    ),
    Row("it waits for that look", lambda known: known.is_held, Wait()),
    Row(
        "the image with which it ends is being denoised",
        lambda known: known.answer is not None and known.is_being_denoised,
        Wait(),
    ),
    Row(
        "a look allows its end, and so far only its sums were stored",
        lambda known: known.is_last and known.is_to_be_denoised,
        DenoiseImage(),
    ),
    Row(
        "the rule is satisfied, by more than the samples of the job that this one continues",
        lambda known: known.is_satisfied and known.may_end and not _is_short(known),
        _converge,
    ),
    Row(
        "the cap is reached",
        lambda known: known.answer is not None and known.at_cap and known.may_end,
        _reach_the_cap,
    ),
    Row(
        "the job goes on",
        lambda known: known.answer is not None,
        lambda known: ShowAndSave(known.is_new, known.is_worth_saving),
    ),
    # Slices, in the order of their indices.
    Row(
        "the image of a point of the curve is being denoised",
        lambda known: known.is_being_denoised,
        Wait(),
    ),
    *_A_POINT,
    Row(
        "the first slice is merged, and the first point is far off",
        lambda known: known.is_to_be_seen,
        ShowFirstSlice(),
    ),
    Row(
        "a slice is in hand",
        lambda known: known.in_hand > 0,
        lambda known: MergeSlice(known.merged),
    ),
    Row(
        "more slices may be committed",
        lambda known: known.ledger is not Ledger.READ,
        lambda known: ReadLedger(range(known.merged, known.merged + BATCH)),
    ),
    # Every committed slice is merged.
    Row(
        "nothing can be seen yet",
        lambda known: (
            known.job.state is JobState.RENDERING
            and not known.merged
            and not known.glimpsed
            and not known.sought_glimpse
        ),
        ShowGlimpse(),
    ),
    Row(
        "the job has a time limit",
        lambda known: known.limited_since_s is not None and known.redis_s is None,
        ReadClock(),
    ),
    Row(
        "its time is up, and it is unknown whether its image can be a result",
        lambda known: known.time_is_up and known.merged > 0 and known.flaw is None,
        InspectImage(),
    ),
    Row("its time is up", lambda known: known.time_is_up, _run_out),
    Row("workers may soon wait", lambda known: known.lacks_slices, _plan),
    Row(
        "the job is paused, and its progress is to be kept",
        lambda known: (
            known.job.state is JobState.PAUSED
            and known.merged > 0
            and (known.is_new or known.is_unsaved)
        ),
        lambda known: ShowAndSave(known.is_new, known.is_unsaved),
    ),
    Row(
        "the image of the newest point is due, and the next point may be far off",
        lambda known: (
            known.is_new and known.judged == known.merged and known.spp > (known.job.image_spp or 0)
        ),
        ShowAndSave(show=True, save=False),
    ),
    Row("nothing is left to do", _always, Wait()),
)


# A job that has ended: complete its image, conclude it, and give it up.


def _conclude(known: Known) -> Step:
    image: FinalImage = "merged" if known.merged else "shown" if known.is_seen else "none"
    spp, notes = {"merged": known.spp, "shown": known.seen_spp, "none": 0}[image], known.job.notes
    if known.lost or spp < known.job.spp:
        when = "after the job had ended" if known.lost else "and not rendered again before the end"
        notes = (*notes, f"the image has {spp} spp: a slice was lost {when}")
    return ConcludeJob(image, spp, notes)


ENDED: Final = (
    Row(
        "it is unknown whether the final image is written",
        lambda known: known.concluded is None,
        ReadConclusion(),
    ),
    Row(
        "the image is being denoised",
        lambda known: known.is_being_denoised,
        Wait(),
    ),
    # A job that continues this one takes over its curve and the memory of its rules.
    Row(
        "the rules have judged a point that the curve lacks",
        lambda known: known.is_to_be_added,
        RecordPoint(),
    ),
    *_A_POINT,
    Row(
        "a slice of the final image is in hand",
        lambda known: known.lacks_final_slices and known.in_hand > 0,
        lambda known: MergeSlice(known.merged),
    ),
    Row(
        "more slices of the final image may be committed",
        lambda known: known.lacks_final_slices and known.ledger is not Ledger.READ,
        lambda known: ReadLedger(
            range(known.merged, min(known.merged + BATCH, known.final_slices))
        ),
    ),
    Row(
        "the final image is to be denoised",
        lambda known: not known.concluded and known.is_to_be_denoised,
        DenoiseImage(),
    ),
    Row("the final image is not written", lambda known: not known.concluded, _conclude),
    Row(
        "the sums are kept, and no checkpoint has all of them",
        lambda known: known.needs_sums and known.merged not in {0, known.saved},
        ShowAndSave(show=False, save=True),
    ),
    Row(
        "nothing else of the job is needed",
        _always,
        lambda known: FinishJob(keeps_sums=known.needs_sums),
    ),
)
