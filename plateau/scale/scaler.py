"""Checks the queue and Slurm at intervals, and does what the policy plans."""

import logging
import threading
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace

from plateau.farm.ledger.totals import take_census
from plateau.farm.ledger.workers import Workers
from plateau.farm.model.errors import StoreUnavailable, WorkerNotFound
from plateau.farm.model.worker import Worker
from plateau.farm.redis.client import RedisClient
from plateau.scale.policy import Policy
from plateau.scale.report import Report
from plateau.scale.slurm import Slurm, SlurmFailed, label
from plateau.scale.tasks import ScalingPlan, Snapshot, TaskState

_LOG = logging.getLogger(__name__)


@dataclass(kw_only=True, eq=False)
class Scaler:
    """Submits and ends workers in Slurm as the queue needs them."""

    client: RedisClient
    workers: Workers
    slurm: Slurm
    policy: Policy
    pool: str  #: of our workers
    tags: Collection[str]  #: of our workers
    from_priority: int | None  #: jobs of a lower priority start no workers
    dry_run: bool  #: report what would be done, and do nothing
    tell: Callable[[Report], None]  #: called with each report that has news
    _told: tuple[object, ...] = ()
    _variants: set[str] = field(default_factory=set)  #: of our workers
    _labels: set[str] = field(default_factory=set)  #: of our workers, past ones included

    def run(self, every_s: float, stop: threading.Event) -> None:
        """Scale every `every_s` seconds until `stop` is set, also after an error."""
        while not stop.is_set():
            try:
                self.step()
            except (SlurmFailed, StoreUnavailable) as error:
                _LOG.error("%s; nothing changes until the next check of the queue", error)
            stop.wait(every_s)

    def step(self) -> None:
        """Take a snapshot, and do what the policy plans.

        Raises `SlurmFailed` or `StoreUnavailable` if Slurm or Redis does not answer.
        """
        snapshot = self._snapshot()
        plan = self.policy.plan(snapshot)
        array = None if self.dry_run else self._do(plan, snapshot)
        command = self.slurm.submission(plan.submit) if self.dry_run and plan.submit else None
        report = replace(Report.of(snapshot, plan), array=array, command=command)
        if plan.acts or report.news() != self._told:
            self.tell(report)
            self._told = report.news()

    def dismiss_all(self) -> None:
        """Cancel the waiting tasks, and ask all other workers to leave."""
        tasks = self.slurm.tasks()
        waiting = [task.id for task in tasks if task.state is TaskState.WAITS]
        running = [task.id for task in tasks if task.state is TaskState.RUNS]
        if waiting:
            self.slurm.cancel_waiting(waiting)
        if running:
            self.slurm.end(running)
        _LOG.info(
            "%d waiting jobs cancelled, %d workers asked to leave", len(waiting), len(running)
        )

    def _snapshot(self) -> Snapshot:
        tasks = self.slurm.tasks()
        # Of two workers with one label the newer counts: Slurm has restarted the task.
        living = sorted(self.workers.living(), key=lambda worker: worker.started_at)
        by_label = {worker.label: worker for worker in living}
        ours = {task.id: by_label[label(task.id)] for task in tasks if label(task.id) in by_label}
        self._labels |= {label(task.id) for task in tasks}
        for worker in ours.values():
            self._variants.update(worker.variants)
        census = take_census(self.client, from_priority=self.from_priority)
        return Snapshot(
            now_s=time.monotonic(),
            demand=census.demand_for(self._variants, pool=self.pool, tags=self.tags),
            tasks=tasks,
            workers=ours,
            others=sum(self._does_the_same(worker) for worker in living),
        )

    def _does_the_same(self, worker: Worker) -> bool:
        """Whether the worker is not ours, and serves the same jobs."""
        if worker.label in self._labels or worker.drained or worker.trouble is not None:
            return False
        if worker.pool != self.pool:
            return False
        return not self._variants or not self._variants.isdisjoint(worker.variants)

    def _do(self, plan: ScalingPlan, snapshot: Snapshot) -> str | None:
        """Carry out the plan; returns the id of the submitted array."""
        if plan.cancel:
            self.slurm.cancel_waiting(plan.cancel)
        if plan.end:
            self.slurm.end(plan.end)
        for task in plan.drain:
            try:
                self.workers.drain(snapshot.workers[task].id)
            except WorkerNotFound:
                _LOG.info("the worker of Slurm job %s has already gone", task)
        if not plan.submit:
            return None
        try:
            array = self.slurm.submit(plan.submit)
        except SlurmFailed:
            self.policy.starts.note_failure(snapshot.now_s)
            raise
        self.policy.starts.note_submitted(plan.submit)
        return array
