"""How many workers a queue is worth, and which come and go for it: no clock, no I/O.

What is wanted rises at once and falls slowly: the most that was wanted within the last `calm_s`
counts, so a job that ends a moment before the next one comes costs nobody a start. Those leave
first who have least to lose: tasks that wait for a machine, tasks whose worker has not come yet,
workers without work. Nobody leaves who renders, unless the limit was lowered.
"""

import math
from collections import deque
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from plateau.farm.ledger.totals import Demand
from plateau.farm.model.job import Worker
from plateau.scale.starts import Starts
from plateau.scale.tasks import Look, Plan, Task, TaskState

#: So many are asked for at once; the rest at the next look.
MOST_AT_ONCE: Final = 100


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What the one who pays for the machines allows."""

    least: int = 0
    most: int
    worth_s: float = 60.0  #: of work for a worker, or it is not worth its start
    calm_s: float = 60.0  #: for so long less has to be wanted before anybody leaves
    idle_s: float = 30.0  #: a worker that had nothing to do for so long may leave


def worth(demand: Demand, worth_s: float) -> int:
    """The number of workers that a demand is worth: each has `worth_s` to do, or a slice of more.

    >>> worth(Demand(waiting=9, leased=1, left=300, work_s=600), 60)
    10
    >>> worth(Demand(waiting=2, left=2, work_s=600), 60)
    2
    >>> worth(Demand(waiting=1, left=1, work_s=0.2), 60)
    1
    """
    return min(math.ceil(demand.work_s / worth_s), demand.left) if demand.slices else 0


class Policy:
    """What to do at each look, within the limits; it remembers what it has seen and done."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._starts = Starts()
        self._wanted: deque[tuple[float, int]] = deque()
        #: By worker: since when it has no work, and how much it had done by then.
        self._idle: dict[str, tuple[float, int]] = {}
        #: By worker that was drained: its last heartbeat by then.
        self._drained: dict[str, datetime] = {}
        #: Tasks that were asked to leave: once, since a second signal would end them by force.
        self._asked: set[str] = set()

    def plan(self, look: Look) -> Plan:
        """What to do now; it is taken to be done, but for what is submitted."""
        self._note_idle(look)
        self._starts.note(look)
        wanted = self._stabilised(look)
        self._asked &= {task.id for task in look.tasks if task.state is TaskState.RUNS}
        staying = [task for task in look.tasks if self._stays(task, look)]
        surplus = max(0, len(staying) - wanted)
        waiting = [task.id for task in staying if task.state is TaskState.WAITS]
        cancelled = waiting[::-1][:surplus]
        surplus -= len(cancelled)
        coming = [task.id for task in staying if _is_coming(task, look)]
        recalled = coming[::-1][:surplus]
        surplus -= len(recalled)
        drained = self._to_drain(staying, look, surplus)
        held_s = self._starts.held_s(look.now_s)
        missing = max(0, wanted - len(staying))
        may_submit = held_s == 0 and not self._somebody_is_free(staying, look)
        plan = Plan(
            wanted=wanted,
            have=len(staying),
            submit=min(missing, MOST_AT_ONCE) if may_submit else 0,
            cancel=tuple(cancelled),
            drain=tuple(drained),
            end=(*recalled, *(task.id for task in look.tasks if self._is_done(task, look))),
            held_s=held_s if missing else 0.0,
        )
        self._starts.dismiss((*plan.cancel, *plan.end))
        self._asked.update(plan.end)
        for task in plan.drain:
            self._drained[look.workers[task].id] = look.workers[task].seen_at
        return plan

    def note_submitted(self, count: int) -> None:
        """Take note that so many tasks were submitted."""
        self._starts.note_submitted(count)

    def note_failure(self, now_s: float) -> None:
        """Take note that nothing could be submitted, and wait with the next try."""
        self._starts.note_failure(now_s)

    def _stabilised(self, look: Look) -> int:
        wanted = max(0, worth(look.demand, self._limits.worth_s) - look.others)
        self._wanted.append((look.now_s, wanted))
        while self._wanted[0][0] < look.now_s - self._limits.calm_s:
            self._wanted.popleft()
        lately = max(wanted for _, wanted in self._wanted)
        return min(max(lately, self._limits.least), self._limits.most)

    def _to_drain(self, staying: list[Task], look: Look, surplus: int) -> list[str]:
        """Whom to give no more slices: who can render nothing, some without work, some too many."""
        working = [task.id for task in staying if task.state is TaskState.RUNS]
        working = [task for task in working if task in look.workers]
        idle = [task for task in working if self._has_idled(look.workers[task], look)]
        idle.sort(key=lambda task: self._idle[look.workers[task].id][0])
        broken = [task for task in idle if look.workers[task].trouble is not None]
        if broken:
            self._starts.note_failure(look.now_s)
        spared = [task for task in idle if task not in broken][: max(0, surplus - len(broken))]
        gone = [*broken, *spared]
        rest = [task for task in working if task not in gone]
        return [*gone, *rest[: max(0, len(rest) - self._limits.most)]]

    def _somebody_is_free(self, staying: list[Task], look: Look) -> bool:
        """Whether a worker finds nothing to do: another would not either."""
        workers = [look.workers[task.id] for task in staying if task.id in look.workers]
        return any(self._has_idled(one, look) and one.trouble is None for one in workers)

    def _stays(self, task: Task, look: Look) -> bool:
        """Whether it is at work, or will be."""
        worker = look.workers.get(task.id)
        sent_away = task.id in self._asked or (worker is not None and worker.drained)
        return task.state is TaskState.WAITS or (task.state is TaskState.RUNS and not sent_away)

    def _is_done(self, task: Task, look: Look) -> bool:
        """Whether its drained worker has nothing in hand, by a heartbeat since it was drained."""
        worker = look.workers.get(task.id)
        if worker is None or not worker.drained or task.state is not TaskState.RUNS:
            return False
        if task.id in self._asked:
            return False
        drained_at = self._drained.setdefault(worker.id, worker.seen_at)
        return worker.job is None and worker.seen_at != drained_at

    def _has_idled(self, worker: Worker, look: Look) -> bool:
        since = self._idle.get(worker.id)
        return since is not None and since[0] <= look.now_s - self._limits.idle_s

    def _note_idle(self, look: Look) -> None:
        idle = {
            worker.id: (look.now_s, worker.slices_done)
            for worker in look.workers.values()
            if worker.job is None
        }
        for one, (_, done) in idle.items():
            if one in self._idle and self._idle[one][1] == done:
                idle[one] = self._idle[one]
        self._idle = idle
        living = {worker.id for worker in look.workers.values()}
        self._drained = {one: at for one, at in self._drained.items() if one in living}


def _is_coming(task: Task, look: Look) -> bool:
    return task.state is TaskState.RUNS and task.id not in look.workers
