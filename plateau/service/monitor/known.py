"""What a monitor knows about a job that it owns, and how each step changes that."""

from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

from plateau.farm.model.job import Job
from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.slices.rounds import Round
from plateau.farm.model.states import JobState
from plateau.service.monitor.look_ahead import LookAhead

#: The shortest time between two shown images of a running job, and the longest, by their cost.
SHOW_EVERY_S: Final = 2.0
SHOW_WITHIN_S: Final = 10.0
#: The share of a monitor's time for the images of one job.
_SHOWING: Final = 0.02
#: The shortest time between two checkpoints.
SAVE_EVERY_S: Final = 5.0
#: The most by which a monitor that is slower than the workers plans further ahead.
_FURTHEST: Final = 8
#: The fewest new slices in a checkpoint; their partials are about as large as the checkpoint.
SLICES_PER_CHECKPOINT: Final = 5


class Ledger(Enum):
    """How much of the ledger the monitor has read in this turn."""

    UNREAD = "unread"
    PARTLY_READ = "partly read"
    READ = "read"


@dataclass(frozen=True)
class RuleAnswer:
    """The verdict of the job's own rule on the merged image."""

    stop: bool
    reason: str
    numbers: dict[str, float | None]
    flaw: str | None  #: why the image cannot be a result, whatever the rule says; None if it can
    expected_spp: int | None  #: where the rule is likely to be satisfied; None if unknown


@dataclass(frozen=True, kw_only=True)
class Known:
    """What a monitor knows about one job.

    A job has many turns. What a turn learns about the ledger, the clock and the end of the job
    holds for this turn only; the rest is kept until another monitor takes over.
    """

    job: Job  #: as it was when the turn began, or when it was read since
    plan: Plan  #: the slices that are decided
    ahead: LookAhead
    keeps_sums: bool  #: whether the sums of ended jobs are kept
    at_s: float = 0.0  #: monotonic time when the turn began, or when the rules answered

    merged: int = 0  #: slices in the sums: 0 … merged − 1
    judged: int = 0  #: slices in the sums when the rules last judged them
    answer: RuleAnswer | None = None  #: the rules' answer, until every step that it causes is taken
    recorded: bool = False  #: whether the curve has the point of that answer
    denoised: int = 0  #: slices in the image that was denoised last
    flaw: str | None = None  #: of the merged image; "" for none, None if not inspected
    planned: int = -1  #: slices before this one are planned; −1 before the first plan
    reach: int = 1  #: by how much more than `enough` is planned, as workers had to wait
    awaited: int = -1  #: slices before this one were planned when the ledger was last read
    shown_spp: int = 0  #: of the image that this monitor showed last
    shown_at_s: float = float("-inf")  #: when it last showed an image after the first
    shown_in_s: float = 0.0  #: what that took
    saved: int = 0  #: slices in the last readable checkpoint
    saved_at_s: float = float("-inf")
    glimpsed: bool = False  #: whether the first pass was shown, or cannot be

    # Of this turn
    enough: int = 0  #: slices beyond the merged ones that keep every worker busy
    ledger: Ledger = Ledger.UNREAD
    in_hand: int = 0  #: slices that were read from the ledger and are not yet merged
    is_dry: bool = False  #: whether they are all that were awaited: workers wait for more
    is_being_denoised: bool = False  #: the merged image
    lost: bool = False  #: whether a partial was lost or damaged
    sought_glimpse: bool = False  #: whether the monitor looked for the first pass
    redis_s: float | None = None  #: Redis's clock in s since 1970; None if not read
    concluded: bool | None = None  #: whether the final image is written; None if not read

    # What follows from these

    @property
    def spp(self) -> int:
        """Samples per pixel in the sums."""
        return self.plan.spp(self.merged)

    @property
    def at_cap(self) -> bool:
        """Whether the cap allows no more slices than those in the sums."""
        return self.plan.is_complete and self.merged == self.plan.stop

    @property
    def may_end(self) -> bool:
        """Whether the merged image may be the last, as far as the job's shot is concerned."""
        frame = self.job.in_shot
        return frame is None or frame.may_end(self.spp)

    @property
    def is_satisfied(self) -> bool:
        """Whether the rule is, by more than the samples of the job that this one continues."""
        is_new = self.spp > self.job.continued_spp
        return self.answer is not None and self.answer.stop and is_new

    @property
    def would_end(self) -> bool:
        """Whether the merged image would be the last, as far as the job alone is concerned."""
        return self.answer is not None and (self.is_satisfied or self.at_cap)

    @property
    def is_last(self) -> bool:
        """Whether no more samples are needed: the merged image ends the job."""
        return self.would_end and self.may_end

    @property
    def is_held(self) -> bool:
        """Whether the merged image would be the last, and its shot is to be looked at before."""
        frame = self.job.in_shot
        if frame is None or not self.would_end:
            return False
        return not self.may_end and not frame.must_go_on(self.spp)

    @property
    def is_waiting(self) -> bool:
        """Whether the frame waits with the merged image, which a checkpoint has."""
        frame = self.job.in_shot
        waits = None if frame is None else frame.waits
        return waits is not None and waits.spp == self.spp and self.saved == self.merged

    @property
    def lacks_slices(self) -> bool:
        """Whether so few slices are planned that workers may soon wait.

        Many slices are not planned one by one, because Redis waits for its disk each time.
        """
        missing = self.stop - self.planned
        return missing > (self.planned - self.merged) // 8

    @property
    def stop(self) -> int:
        """The first slice that should not be planned yet: no more is at stake than is merged."""
        enough = max(self.enough, min(self.enough * self.reach, self.merged))
        return self._ahead_of_shot.stop(self.plan, self.merged, enough)

    @property
    def _ahead_of_shot(self) -> LookAhead:
        """The look-ahead, to where a look at its shot has asked for samples."""
        frame = self.job.in_shot
        needs = None if frame is None or frame.answer is None else frame.answer.needs_spp
        if needs is None or self.ahead.expected_spp is None:
            return self.ahead
        return self.ahead.expecting(max(needs, self.ahead.expected_spp))

    @property
    def is_to_be_judged(self) -> bool:
        """Whether the sums have reached a point of the curve that the rules have not judged."""
        return self.judged < self.merged and self.plan.is_point(self.merged)

    @property
    def is_to_be_added(self) -> bool:
        """Whether the rules have judged an image that the curve of the ended job lacks."""
        is_judged = self.answer is not None and self.judged == self.merged
        return is_judged and not self.recorded and self.spp > self.job.spp

    @property
    def is_to_be_denoised(self) -> bool:
        """Whether the merged image is denoised before anybody judges it, or has it as a result."""
        return self.job.spec.is_denoised and self.merged > 1 and self.denoised != self.merged

    @property
    def seen_spp(self) -> int:
        """The spp of the image that is shown."""
        return max(self.job.image_spp or 0, self.shown_spp)

    @property
    def is_seen(self) -> bool:
        """Whether an image of whole slices is shown."""
        return self.seen_spp >= self.job.spec.slice_spp

    @property
    def is_to_be_seen(self) -> bool:
        """Whether the first slice is to be shown, as the first point of the curve is far off."""
        is_first = self.merged == 1 and not self.judged and not self.is_seen
        return is_first and self.job.spec.pictures

    @property
    def is_new(self) -> bool:
        """Whether the merged image has changed and is due to be shown."""
        wait_s = max(SHOW_EVERY_S, min(self.shown_in_s / _SHOWING, SHOW_WITHIN_S))
        is_due = self.spp != self.shown_spp and self.at_s >= self.shown_at_s + wait_s
        # Between two denoised images there is none to show.
        return is_due and self.job.spec.pictures and not self.is_to_be_denoised

    @property
    def is_unsaved(self) -> bool:
        """Whether the sums have changed and are due to be saved."""
        return self.merged != self.saved and self.at_s >= self.saved_at_s + SAVE_EVERY_S

    @property
    def is_worth_saving(self) -> bool:
        """Whether the sums are due to be saved, with enough new slices."""
        return self.merged >= self.saved + SLICES_PER_CHECKPOINT and self.is_unsaved

    @property
    def time_is_up(self) -> bool:
        """Whether the job has exceeded its time limit, by the clock that was read."""
        limit_s = self.job.spec.time_limit_s
        if limit_s is None or self.limited_since_s is None or self.redis_s is None:
            return False
        return self.redis_s - self.limited_since_s - self.job.paused_s > limit_s

    @property
    def limited_since_s(self) -> float | None:
        """The start of the time limit, in s since 1970; None without one or during a pause."""
        job = self.job
        if job.spec.time_limit_s is None or job.state is JobState.PAUSED:
            return None
        begin = job.created_at if job.spec.time_limit_from == "submission" else job.started_at
        return None if begin is None else begin.timestamp()

    @property
    def needs_sums(self) -> bool:
        """Whether the sums stay once the job has ended; kept slices make them superfluous."""
        return self.keeps_sums and not self.job.spec.keep_slices

    @property
    def final_slices(self) -> int:
        """The number of slices in the final image, if all of them are committed.

        A converged job's image is the judged one. A failed job's image has what any monitor had
        merged. Any other image takes every committed slice.
        """
        job, plan = self.job, self.plan
        if job.state is JobState.CONVERGED:
            return plan.slices_of(job.spp)
        if job.state is JobState.FAILED:  # an image may have been shown before it was judged
            return max(self.merged, plan.slices_of(max(job.spp, job.image_spp or 0)))
        return plan.stop

    @property
    def lacks_final_slices(self) -> bool:
        """Whether the final image needs slices that the ledger may still have."""
        is_needed = not self.concluded or self.needs_sums
        return is_needed and not self.lost and self.merged < self.final_slices

    # The outcomes of steps that change several fields

    def with_wait(self) -> "Known":
        """The sums were recovered: those with which a frame waits have the rules' answer, too."""
        frame = self.job.in_shot
        waits = None if frame is None else frame.waits
        if waits is None or self.merged == 0 or waits.spp != self.spp:
            return self
        answer = RuleAnswer(waits.stop, waits.reason, waits.numbers, flaw=None, expected_spp=None)
        return replace(self, answer=answer, recorded=True)

    def turn(self, job: Job, enough: int, at_s: float) -> "Known":
        """The job was read and its turn begins: what earlier turns read no longer counts."""
        return replace(
            self,
            job=job,
            enough=enough,
            at_s=at_s,
            ledger=Ledger.UNREAD,
            in_hand=0,
            is_dry=False,
            is_being_denoised=False,
            lost=False,
            sought_glimpse=False,
            redis_s=None,
            concluded=None,
        )

    def read_again(self, job: Job) -> "Known":
        """The job was read again after its end: its turn starts anew."""
        return self.turn(job, self.enough, self.at_s)

    def with_time(self, job: Job, redis_s: float) -> "Known":
        """The clock and the job were read; the job may have ended meanwhile."""
        known = self.read_again(job) if job.state.ended else replace(self, job=job)
        return replace(known, redis_s=redis_s)

    def with_film(self, width: int | None, height: int | None) -> "Known":
        """The size of the film, which is known from the first commit on, was read."""
        return replace(self, plan=replace(self.plan, width=width, height=height))

    def with_point(self, decided: Round | None, expected_spp: int | None) -> "Known":
        """The curve has the point, and the plan what its image has decided: a round, a look.

        `expected_spp` is where the image expects the job to end.
        """
        plan = self.plan if decided is None else self.plan.with_round(decided)
        return replace(self, recorded=True, plan=plan.with_point(self.merged, expected_spp))

    def with_slices(self, found: int, asked: int) -> "Known":
        """Of the slices asked for, this many are committed."""
        ledger = Ledger.READ if found < asked else Ledger.PARTLY_READ
        # Workers were faster than this monitor's judging: more slices keep them busy meanwhile.
        is_dry = found > 0 and self.merged + found >= self.awaited >= 0
        return replace(
            self,
            in_hand=found,
            ledger=ledger,
            is_dry=is_dry,
            reach=min(2 * self.reach, _FURTHEST) if is_dry else self.reach,
            awaited=self.planned,
        )

    def with_slice_merged(self) -> "Known":
        """The next slice is in the sums."""
        in_hand, is_dry = self.in_hand - 1, self.is_dry and self.in_hand > 1
        return replace(self, merged=self.merged + 1, in_hand=in_hand, is_dry=is_dry, flaw=None)

    def with_slice_lost(self) -> "Known":
        """The partial of the next slice is lost or damaged, so no later slice can be merged."""
        return replace(self, in_hand=0, is_dry=False, ledger=Ledger.READ, lost=True)

    def with_denoised(self, *, is_done: bool) -> "Known":
        """The merged image is denoised, or being denoised."""
        if not is_done:
            return replace(self, is_being_denoised=True)
        return replace(self, denoised=self.merged)

    def with_answer(self, answer: RuleAnswer, at_s: float) -> "Known":
        """The rules have judged the merged image."""
        return replace(
            self,
            judged=self.merged,
            answer=answer,
            recorded=False,
            ahead=self.ahead.expecting(answer.expected_spp),
            at_s=at_s,
        )

    def with_glimpse(self, spp: int | None) -> "Known":
        """The first pass was shown, cannot be shown (0 spp), or does not exist yet (None)."""
        known = replace(self, glimpsed=spp is not None, sought_glimpse=True)
        return replace(known, shown_spp=spp) if spp else known
