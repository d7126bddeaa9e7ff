"""The input and the output of the policy.

A job of the batch system is called a *task* here, since a *job* is an image to render.
"""

from dataclasses import dataclass
from enum import Enum

from plateau.farm.ledger.totals import Demand
from plateau.farm.model.worker import Worker


class TaskState(Enum):
    """The state of a task."""

    WAITS = "waits"  #: for a machine
    RUNS = "runs"
    LEAVES = "leaves"  #: it is ending


@dataclass(frozen=True, kw_only=True)
class Task:
    """One of our jobs in the batch system, which runs one worker."""

    id: str
    state: TaskState
    why: str = ""  #: the batch system's reason why it waits


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    """The state of the farm and of the batch system at one moment."""

    now_s: float  #: by a monotonic clock
    demand: Demand  #: the work that our workers could do
    tasks: tuple[Task, ...]  #: in the order of their submission
    workers: dict[str, Worker]  #: our living workers by their task
    others: int  #: workers that are not ours and could do the same work


@dataclass(frozen=True, kw_only=True)
class ScalingPlan:
    """What to do after a snapshot."""

    wanted: int  #: number of tasks, within the limits and after smoothing
    have: int  #: tasks that are at work, or will be
    submit: int = 0  #: number of new tasks
    cancel: tuple[str, ...] = ()  #: waiting tasks to cancel
    drain: tuple[str, ...] = ()  #: tasks whose worker should take no more slices
    end: tuple[str, ...] = ()  #: tasks whose idle worker should leave
    held_s: float = 0.0  #: how long to submit nothing, because the last tasks brought no worker

    @property
    def acts(self) -> bool:
        """Whether there is anything to do."""
        return bool(self.submit or self.cancel or self.drain or self.end)
