"""The states of a job and of a slice, and the only moves between them."""

from enum import Enum
from typing import Final


class JobState(str, Enum):
    """Where a job stands."""

    QUEUED = "queued"
    RENDERING = "rendering"
    PAUSED = "paused"
    CONVERGED = "converged"  #: a rule fired
    EXHAUSTED = "exhausted"  #: the sample cap or the time limit ended it without
    CANCELLED = "cancelled"
    FAILED = "failed"

    @property
    def ended(self) -> bool:
        """Whether nothing can happen to the job any more."""
        return not JOB_MOVES[self]


_ENDS: Final = frozenset(
    {JobState.CONVERGED, JobState.EXHAUSTED, JobState.CANCELLED, JobState.FAILED}
)

JOB_MOVES: Final[dict[JobState, frozenset[JobState]]] = {
    JobState.QUEUED: frozenset({JobState.RENDERING, JobState.CANCELLED, JobState.FAILED}),
    JobState.RENDERING: _ENDS | {JobState.PAUSED},
    # What was being rendered when it was paused may be all that the rule, or the cap, waited for.
    JobState.PAUSED: _ENDS | {JobState.RENDERING},
    JobState.CONVERGED: frozenset(),
    JobState.EXHAUSTED: frozenset(),
    JobState.CANCELLED: frozenset(),
    JobState.FAILED: frozenset(),
}


def sources(target: JobState) -> tuple[JobState, ...]:
    """The states from which a job may become `target`."""
    return tuple(state for state, targets in JOB_MOVES.items() if target in targets)


class SliceState(str, Enum):
    """Where a slice stands; it is read off the job's stream and ledger, never stored."""

    PLANNED = "planned"  #: in the stream, given to nobody
    LEASED = "leased"  #: in the stream's pending list
    COMMITTED = "committed"  #: in the ledger
    WITHDRAWN = "withdrawn"  #: the job ended first
    POISONED = "poisoned"  #: three workers died on it; the job has failed


SLICE_MOVES: Final[dict[SliceState, frozenset[SliceState]]] = {
    SliceState.PLANNED: frozenset({SliceState.LEASED, SliceState.WITHDRAWN}),
    SliceState.LEASED: frozenset(
        {SliceState.COMMITTED, SliceState.PLANNED, SliceState.WITHDRAWN, SliceState.POISONED}
    ),
    SliceState.COMMITTED: frozenset(),
    SliceState.WITHDRAWN: frozenset(),
    SliceState.POISONED: frozenset(),
}

#: So many workers may die on one slice before its job fails.
MAX_TRIES: Final = 3
