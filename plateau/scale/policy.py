"""Decides how many workers a queue needs, and which tasks to start and end: no clock, no I/O.

The wanted number rises at once and falls slowly: the maximum over the last `calm_s` counts, so a
short gap between two jobs ends no worker. Tasks end in this order: tasks that wait for a machine,
tasks whose worker has not started yet, idle workers. A rendering worker ends only if the limit was
lowered.
"""

import math
from collections import deque
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from plateau.farm.ledger.totals import Demand
from plateau.farm.model.worker import Worker
from plateau.scale.starts import Starts
from plateau.scale.tasks import ScalingPlan, Snapshot, Task, TaskState

#: Most tasks in one submission; the rest follows after the next snapshot.
MOST_AT_ONCE: Final = 100


@dataclass(frozen=True, kw_only=True)
class Limits:
    """The user's limits on the number of workers."""

    least: int = 0
    most: int
    worth_s: float = 60.0  #: work that justifies the start of a worker
    calm_s: float = 60.0  #: workers end only after fewer were wanted for this long
    idle_s: float = 30.0  #: a worker ends only after it was idle for this long


def worth(demand: Demand, worth_s: float) -> int:
    """The number of workers for a demand: each has work for `worth_s`, or one longer slice.

    >>> worth(Demand(waiting=9, leased=1, left=300, work_s=600), 60)
    10
    >>> worth(Demand(waiting=2, left=2, work_s=600), 60)
    2
    >>> worth(Demand(waiting=1, left=1, work_s=0.2), 60)
    1
    """
    return min(math.ceil(demand.work_s / worth_s), demand.left) if demand.slices else 0


class Policy:
    """Plans what to do after each snapshot, within the limits; it remembers earlier ones."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self.starts = Starts()
        self._wanted: deque[tuple[float, int]] = deque()
        #: By worker: since when it is idle, and its slices done by then.
        self._idle: dict[str, tuple[float, int]] = {}
        #: By drained worker: its last heartbeat before it was drained.
        self._drained: dict[str, datetime] = {}
        #: Tasks that were asked to leave, once each: a second signal would end them by force.
        self._asked: set[str] = set()

    def plan(self, snapshot: Snapshot) -> ScalingPlan:
        """What to do now. The policy assumes that it is done, except for submissions."""
        self._note_idle(snapshot)
        self.starts.note(snapshot)
        wanted = self._stabilised(snapshot)
        self._asked &= {task.id for task in snapshot.tasks if task.state is TaskState.RUNS}
        staying = [task for task in snapshot.tasks if self._stays(task, snapshot)]
        surplus = max(0, len(staying) - wanted)
        waiting = [task.id for task in staying if task.state is TaskState.WAITS]
        cancelled = waiting[::-1][:surplus]
        surplus -= len(cancelled)
        coming = [
            task.id
            for task in staying
            if task.state is TaskState.RUNS and task.id not in snapshot.workers
        ]
        recalled = coming[::-1][:surplus]
        surplus -= len(recalled)
        drained = self._to_drain(staying, snapshot, surplus)
        held_s = self.starts.held_s(snapshot.now_s)
        missing = max(0, wanted - len(staying))
        may_submit = held_s == 0 and not self._somebody_is_free(staying, snapshot)
        plan = ScalingPlan(
            wanted=wanted,
            have=len(staying),
            submit=min(missing, MOST_AT_ONCE) if may_submit else 0,
            cancel=tuple(cancelled),
            drain=tuple(drained),
            end=(*recalled, *(task.id for task in snapshot.tasks if self._is_done(task, snapshot))),
            held_s=held_s if missing else 0.0,
        )
        self.starts.dismiss((*plan.cancel, *plan.end))
        self._asked.update(plan.end)
        for task in plan.drain:
            self._drained[snapshot.workers[task].id] = snapshot.workers[task].seen_at
        return plan

    def _stabilised(self, snapshot: Snapshot) -> int:
        wanted = max(0, worth(snapshot.demand, self._limits.worth_s) - snapshot.others)
        self._wanted.append((snapshot.now_s, wanted))
        while self._wanted[0][0] < snapshot.now_s - self._limits.calm_s:
            self._wanted.popleft()
        lately = max(wanted for _, wanted in self._wanted)
        return min(max(lately, self._limits.least), self._limits.most)

    def _to_drain(self, staying: list[Task], snapshot: Snapshot, surplus: int) -> list[str]:
        """The tasks to drain: broken workers, surplus idle ones, and those above the limit."""
        working = [task.id for task in staying if task.state is TaskState.RUNS]
        working = [task for task in working if task in snapshot.workers]
        idle = [task for task in working if self._has_idled(snapshot.workers[task], snapshot)]
        idle.sort(key=lambda task: self._idle[snapshot.workers[task].id][0])
        broken = [task for task in idle if snapshot.workers[task].trouble is not None]
        if broken:
            self.starts.note_failure(snapshot.now_s)
        spared = [task for task in idle if task not in broken][: max(0, surplus - len(broken))]
        gone = [*broken, *spared]
        rest = [task for task in working if task not in gone]
        return [*gone, *rest[: max(0, len(rest) - self._limits.most)]]

    def _somebody_is_free(self, staying: list[Task], snapshot: Snapshot) -> bool:
        """Whether a worker is idle; a new one would be idle too."""
        workers = [snapshot.workers[task.id] for task in staying if task.id in snapshot.workers]
        return any(self._has_idled(one, snapshot) and one.trouble is None for one in workers)

    def _stays(self, task: Task, snapshot: Snapshot) -> bool:
        """Whether the task is at work, or will be."""
        worker = snapshot.workers.get(task.id)
        sent_away = task.id in self._asked or (worker is not None and worker.drained)
        return task.state is TaskState.WAITS or (task.state is TaskState.RUNS and not sent_away)

    def _is_done(self, task: Task, snapshot: Snapshot) -> bool:
        """Whether its worker is idle according to a heartbeat after it was drained."""
        worker = snapshot.workers.get(task.id)
        if worker is None or not worker.drained or task.state is not TaskState.RUNS:
            return False
        if task.id in self._asked:
            return False
        drained_at = self._drained.setdefault(worker.id, worker.seen_at)
        return worker.job is None and worker.seen_at != drained_at

    def _has_idled(self, worker: Worker, snapshot: Snapshot) -> bool:
        since = self._idle.get(worker.id)
        return since is not None and since[0] <= snapshot.now_s - self._limits.idle_s

    def _note_idle(self, snapshot: Snapshot) -> None:
        idle = {
            worker.id: (snapshot.now_s, worker.slices_done)
            for worker in snapshot.workers.values()
            if worker.job is None
        }
        for one, (_, done) in idle.items():
            if one in self._idle and self._idle[one][1] == done:
                idle[one] = self._idle[one]
        self._idle = idle
        living = {worker.id for worker in snapshot.workers.values()}
        self._drained = {one: at for one, at in self._drained.items() if one in living}
