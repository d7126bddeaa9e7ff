"""The states of a job and of a slice, and the only moves between them."""

from enum import Enum
from typing import Final, Literal


class JobState(str, Enum):
    """The state of a job."""

    QUEUED = "queued"
    RENDERING = "rendering"
    PAUSED = "paused"
    CONVERGED = "converged"  #: a rule fired
    EXHAUSTED = "exhausted"  #: the cap or the time limit ended it without
    CANCELLED = "cancelled"
    FAILED = "failed"

    @property
    def ended(self) -> bool:
        """Whether no move leads out of the state."""
        return not JOB_MOVES[self]

    @property
    def in_words(self) -> str:
        """The state as people read it."""
        return "reached its limit" if self is JobState.EXHAUSTED else self.value

    @property
    def clause(self) -> str:
        """The same with its verb, to be put behind a job."""
        return f"has {self.in_words}" if self is JobState.EXHAUSTED else f"is {self.value}"


#: What ended a job: its rule; the most samples or the time that it may have; a person;
#: what it waited for, which ended badly; a scene that cannot be rendered; the deaths of all workers
#: that tried a slice; an image that is no result, with too many NaNs; or a fault in the farm.
EndedBy = Literal[
    "rule",
    "cap",
    "time_limit",
    "person",
    "predecessor",
    "scene",
    "deaths",
    "image",
    "farm",
]


def outcome(state: JobState, ended_by: EndedBy | None) -> str:
    """The state as people read it; of an exhausted job, which limit it reached."""
    if state is JobState.EXHAUSTED and ended_by is not None:
        return f"reached its {ended_by.replace('_', ' ')}"
    return state.in_words


_ENDS: Final = frozenset(
    {JobState.CONVERGED, JobState.EXHAUSTED, JobState.CANCELLED, JobState.FAILED}
)

JOB_MOVES: Final[dict[JobState, frozenset[JobState]]] = {
    JobState.QUEUED: frozenset({JobState.RENDERING, JobState.CANCELLED, JobState.FAILED}),
    JobState.RENDERING: _ENDS | {JobState.PAUSED},
    # The slices in hand at a pause may be the last that the rule, or the cap, needed.
    JobState.PAUSED: _ENDS | {JobState.RENDERING},
    JobState.CONVERGED: frozenset(),
    JobState.EXHAUSTED: frozenset(),
    JobState.CANCELLED: frozenset(),
    JobState.FAILED: frozenset(),
}


#: Workers that may die on one slice before its job fails.
MAX_TRIES: Final = 3
