"""A job, its curve and its events, as every process and every user sees them."""

from datetime import datetime, timezone
from typing import Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from plateau.farm.model.shot import FrameOfShot
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.spec.parts import FramesBecause
from plateau.farm.model.states import EndedBy, JobState


def moment(milliseconds: str | int | float) -> datetime:
    """A time of Redis's clock as an aware datetime in UTC."""
    return datetime.fromtimestamp(float(milliseconds) / 1000, timezone.utc)


def utc_now() -> datetime:
    """Now, by this machine's clock."""
    return datetime.now(timezone.utc)


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class WatchedValue(_Record):
    """What a rule said at a point of the curve."""

    value: float | None = Field(description="the number that the rule watches")
    stop: bool = Field(description="whether the rule would have stopped here")
    low: float | None = Field(
        None, description="of an error: the interval that holds the truth in 95 of 100 cases"
    )
    high: float | None = None
    few_share: float | None = Field(
        None,
        description="the share of the squared error that a ten-thousandth of the pixels holds, one "
        "at least; from 0.1 on they are fireflies",
    )


class CurvePoint(_Record):
    """One evaluation: the merged image at `spp`, judged."""

    spp: int = Field(
        description="samples per pixel in the merged image; by zones their mean, rounded down"
    )
    visible_pixels: int = Field(
        description="changed since the first image: pixels that differ visibly from that of the "
        "curve's first point"
    )
    visible_fraction: float = Field(description="the same over all pixels, in [0, 1]")
    slope: float | None = Field(
        description="least-squares slope of visible_pixels over spp; null before the window is full"
    )
    estimate_pixels: float | None = Field(
        description="noise left: pixels that differ visibly from the converged image, by the "
        "half-buffer estimate"
    )
    estimate_fraction: float | None = Field(description="the same over all pixels, in [0, 1]")
    estimate_low_pixels: float | None = Field(
        None, description="the band that holds the true count in about nine cases of ten"
    )
    estimate_high_pixels: float | None = None
    estimate_undetermined: bool | None = Field(
        None,
        description="whether the samples do not tell yet how wrong the denoiser is: the noise left "
        "may be more than twice as much, and more than twice the target; then the rule `visible` "
        "goes on. Null where the image is not denoised",
    )
    raw_estimate_pixels: float | None = Field(
        None, description="noise left in the image before it was denoised, where it is"
    )
    expected_spp: int | None = Field(
        None,
        description="spp at which the job is likely to end, by its rule and its min_spp, as far as "
        "the image tells",
    )
    non_finite_pixels: int = Field(
        0, description="pixels with a NaN or an infinity, left out of every other count"
    )
    spp_min: int | None = Field(
        None, description="samples per pixel of the zone that has the fewest, by zones"
    )
    spp_max: int | None = Field(None, description="of the zone that has the most")
    samples: int | None = Field(
        None, description="samples of the image over all pixels; not known of older points"
    )
    at: datetime = Field(description="when it was evaluated, by Redis's clock")
    rules: dict[str, WatchedValue] = Field(
        default_factory=dict, description="the stopping rule and each watched one"
    )


#: Why a job has nothing of another one's samples: none are left.
NONE_LEFT: Final = "gone"


class Again(_Record):
    """What a job that renders an ended one again has of its samples."""

    of: str = Field(description="id of the ended job")
    kept_spp: int = Field(description="its samples that this job has; 0 if all is rendered anew")
    why: str | None = Field(
        None,
        description="if none are kept: the field of this job's spec that prevents it, or `gone` if "
        "none are left",
    )


class Notice(_Record):
    """What became of the notice to one of those who are to hear of a job's end."""

    to: str = Field(description="a target's name, or scheme, host and port of the notice's URL")
    state: Literal["waiting", "delivered", "given-up"] = Field(
        description="whether it waits for its next try, or was given up: after a day, or as the "
        "receiver answered 410"
    )
    at: datetime = Field(description="since when, or when its last try ended")
    error: str | None = Field(None, description="why its last try did not deliver it")


class Job(_Record):
    """A job: one image on its way to where more samples change nothing that a person sees."""

    id: str
    name: str = Field(description="its own name, or its scene's")
    owner: str | None = Field(
        None, description="id of the API key that made it; null where it was made without one"
    )
    owner_name: str | None = Field(None, description="name of that key")
    state: JobState
    outcome: str = Field(
        description="its state in words; of an exhausted job, which limit it reached"
    )
    reason: str = Field(description="why the job is in this state, in words")
    ended_by: EndedBy | None = Field(None, description="what ended it; null while it is open")
    failed_slice: int | None = Field(
        None, description="the slice that could not be rendered, where that failed the job"
    )
    spec: JobSpec
    frames_because: FramesBecause | None = Field(
        None,
        description="why the allocation `auto` became frame; null where it became zones, is not "
        "decided yet, or was asked for by name",
    )
    scene_sha256: str
    variant: str | None = Field(description="the variant, pinned by the first lease")
    width: int | None = Field(description="film width in pixels")
    height: int | None = Field(description="film height in pixels")
    spp: int = Field(
        description="samples per pixel in the merged image; by zones their mean, rounded down"
    )
    spp_min: int | None = Field(
        None,
        description="by zones: of the zone that has the fewest, at the newest point; of an ended "
        "job, in its image",
    )
    spp_max: int | None = Field(None, description="of the zone that has the most, there")
    held: bool = Field(
        False, description="whether it is queued and held back, until it or its batch is resumed"
    )
    awaits: int = Field(
        0, description="how many of `spec.after` have not ended yet; `reason` names them"
    )
    image_spp: int | None = Field(
        None, description="samples per pixel of the newest image that can be fetched, if any can"
    )
    committed_spp: int = Field(description="samples per pixel in the ledger, merged or not")
    points: int = Field(description="points of the curve")
    visible_pixels: int | None = Field(
        None, description="changed since the first image, in pixels, at the newest point"
    )
    visible_fraction: float | None = Field(None, description="the same over all pixels")
    slope: float | None = Field(None, description="of visible_pixels over spp, there")
    estimate_pixels: float | None = Field(
        None, description="noise left, in pixels, at the newest point"
    )
    estimate_fraction: float | None = Field(None, description="the same over all pixels")
    estimate_undetermined: bool | None = Field(
        None, description="whether it may be far more, there, as far as the samples tell"
    )
    non_finite_pixels: int | None = Field(
        None,
        description="pixels of the last judged image with a NaN or an infinity; they are left out "
        "of every other count, and more than 0.1 % of them fail the job",
    )
    expected_spp: int | None = Field(
        None, description="spp at which the job is likely to end, by its own rule, if known"
    )
    expected_s: float | None = Field(
        None, description="seconds from the last point to there, at the job's mean rate"
    )
    verdict: dict[str, float | None] | None = Field(
        None, description="the numbers of the rule that fired"
    )
    samples_saved: int = Field(
        0,
        description="samples (not spp) that a converged job would have cost otherwise: those of "
        "its cap, without those that it has or took over; none by the rule fixed",
    )
    machine_s: float = Field(description="seconds that render children spent on the job")
    core_hours: float = Field(
        0.0,
        description="the same times the threads of each render child, in hours: of all tries, "
        "wasted ones too, but those that were lost with their worker; time counted by an older "
        "Plateau is that of one thread",
    )
    saved_fraction: float = Field(
        0.0, description="`samples_saved` over the samples of the cap, in [0, 1)"
    )
    saved_core_hours: float = Field(
        0.0,
        description="core hours that `samples_saved` would have cost at the job's mean rate, an "
        "estimate",
    )
    wasted_s: float = Field(
        0.0, description="seconds of those on tries of slices of which another was committed first"
    )
    second_tries: int = Field(
        0, description="slices that were late, and that a second worker was given too"
    )
    notes: tuple[str, ...] = Field(
        (),
        description="what the farm changed in the scene, and flaws of the image that end nothing",
    )
    again: Again | None = Field(
        None, description="of a job that renders an ended one again: what it has of it"
    )
    continued_spp: int = Field(
        0, description="up to here, the points of the curve are those of the job of `again`"
    )
    in_shot: FrameOfShot | None = Field(None, description="of a frame of a shot: how it stands")
    notices: tuple[Notice, ...] = Field(
        (), description="what became of its notices, once its results are written"
    )
    created_at: datetime
    started_at: datetime | None = None
    paused_at: datetime | None = Field(None, description="since when it is paused, where it is")
    paused_s: float = Field(
        0.0,
        description="seconds that it was paused since its start, not counting a pause that lasts",
    )
    ended_at: datetime | None = None
    finished_at: datetime | None = Field(
        None, description="when the final images were written and everything else was cleared"
    )

    deleted_at: datetime | None = Field(
        None,
        description="when it was deleted: it is hidden, and can be restored until a sweep removes "
        "it after PLATEAU_KEEP_DELETED_DAYS",
    )

    def duration_s(self, now: datetime) -> float:
        """Seconds from its submission to its end, or until `now`: waits and pauses count."""
        return max(0.0, ((self.ended_at or now) - self.created_at).total_seconds())


#: An `Event.id` before those of all events.
BEFORE_ALL_EVENTS: Final = "0-0"


class Event(_Record):
    """Something that happened to a job; `id` orders events and resumes a stream of them."""

    id: str
    type: str = Field(description="state, image, point, rendered, slice, trouble or finished")
    data: dict[str, object]
    at: datetime


#: How a try of a slice ended; `LogEntry.what` explains each.
TryEnd = Literal[
    "committed", "duplicate", "stale", "handed-back", "unfit", "died", "failed", "rejected"
]


class LogEntry(_Record):
    """How one try of a slice ended."""

    at: datetime
    slice: int
    worker: str
    what: TryEnd = Field(
        description="how it ended: in the ledger (committed), after another try that was committed "
        "(duplicate), too late for its variant (stale), back in the queue (handed-back, or unfit: "
        "the worker can render nothing), with a dead render child or worker (died), with the scene "
        "at fault (failed), or committed once but its partial was lost or spoiled (rejected)"
    )
    cause: str | None = Field(None, description="why, where it was not simply committed")
    seconds: float | None = Field(None, description="how long it took, where that is known")
    text: str = Field(
        "", description="what Mitsuba printed while it loaded and rendered: its last 4 KB"
    )
