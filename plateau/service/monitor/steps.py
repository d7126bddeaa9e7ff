"""A monitor's steps with a job: `decisions` chooses one, `job_run` takes it."""

from dataclasses import dataclass
from typing import Literal

from plateau.farm.model.states import EndedBy, JobState


@dataclass(frozen=True)
class PlanSlices:
    """Let workers lease every slice before `stop`."""

    stop: int
    expected_spp: int  #: where the job is likely to end, for the farm's census


@dataclass(frozen=True)
class ReadLedger:
    """Read the records of these slices, up to the first that is not committed."""

    slices: range


@dataclass(frozen=True)
class MergeSlice:
    """Add this slice, which was read from the ledger, to the sums."""

    index: int


@dataclass(frozen=True)
class DenoiseImage:
    """Have the merged image denoised, or look whether it is by now."""


@dataclass(frozen=True)
class JudgeImage:
    """Have every rule judge the merged image."""


@dataclass(frozen=True)
class RecordPoint:
    """Append the point that was judged last to the curve."""


@dataclass(frozen=True)
class ShowAndSave:
    """Show the merged image, and save a checkpoint of the sums: both, either or neither."""

    show: bool
    save: bool


@dataclass(frozen=True)
class HoldFrame:
    """Show the merged image and save the sums: the frame waits with them for a look at its shot."""


@dataclass(frozen=True)
class ShowFirstSlice:
    """Show the image of the first slice, long before the first point of the curve."""


@dataclass(frozen=True)
class ShowGlimpse:
    """Show the first pass of the first slice, if a worker has uploaded it."""


@dataclass(frozen=True)
class ReadClock:
    """Read Redis's clock and the job, which may have been paused meanwhile."""


@dataclass(frozen=True)
class InspectImage:
    """Check whether too many pixels of the merged image are NaN or infinite."""


@dataclass(frozen=True)
class EndJob:
    """Move the job to one of its last states, and read it again."""

    state: JobState
    ended_by: EndedBy
    reason: str
    numbers: dict[str, float | None] | None = None  #: of the rule that fired
    #: Whether the merged image is the final one; it is written first, and the job ends and is
    #: concluded at once. Otherwise committed slices may still be added.
    with_image: bool = False


@dataclass(frozen=True)
class ReadConclusion:
    """Read whether the final image of the ended job is written."""


#: The final image of a job: the merged one, the one shown last, or none.
FinalImage = Literal["merged", "shown", "none"]


@dataclass(frozen=True)
class ConcludeJob:
    """Write the final image of the ended job, and record that."""

    image: FinalImage
    spp: int
    notes: tuple[str, ...]


@dataclass(frozen=True)
class FinishJob:
    """Delete the files of the ended job that nobody needs, and give the job up for good."""

    keeps_sums: bool  #: whether its last checkpoint stays


@dataclass(frozen=True)
class AbandonJob:
    """Give up a job that Redis has lost."""


@dataclass(frozen=True)
class Wait:
    """Do nothing until the job's next turn."""


Step = (
    PlanSlices
    | ReadLedger
    | MergeSlice
    | DenoiseImage
    | JudgeImage
    | RecordPoint
    | ShowAndSave
    | HoldFrame
    | ShowFirstSlice
    | ShowGlimpse
    | ReadClock
    | InspectImage
    | EndJob
    | ReadConclusion
    | ConcludeJob
    | FinishJob
    | Wait
)
