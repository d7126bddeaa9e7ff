"""What the policy looks at, and what it answers.

A job of a batch system is a *task* here, since a job is an image.
"""

from dataclasses import dataclass
from enum import Enum

from plateau.farm.ledger.totals import Demand
from plateau.farm.model.job import Worker


class TaskState(Enum):
    """Where a task is on its way, as far as it matters here."""

    WAITS = "waits"  #: for a machine
    RUNS = "runs"
    LEAVES = "leaves"  #: it ends by itself


@dataclass(frozen=True, kw_only=True)
class Task:
    """One of our jobs in the batch system: one worker, sooner or later."""

    id: str
    state: TaskState
    why: str = ""  #: it waits, in the batch system's words


@dataclass(frozen=True, kw_only=True)
class Look:
    """What there is at a moment."""

    now_s: float  #: by a clock that never goes back
    demand: Demand  #: that our workers could serve
    tasks: tuple[Task, ...]  #: in the order in which they were submitted
    workers: dict[str, Worker]  #: by task, those that live
    others: int  #: workers at work that are not ours, and could serve the same


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is to be done about it."""

    wanted: int  #: tasks, when the limits and what was wanted lately are heeded
    have: int  #: tasks that are at work, or will be
    submit: int = 0
    cancel: tuple[str, ...] = ()  #: tasks that wait
    drain: tuple[str, ...] = ()  #: tasks whose worker is to take no more slices
    end: tuple[str, ...] = ()  #: tasks whose worker has nothing in hand
    held_s: float = 0.0  #: for so long nothing is submitted, since the last tasks came to nothing

    @property
    def acts(self) -> bool:
        """Whether there is anything to do."""
        return bool(self.submit or self.cancel or self.drain or self.end)
