"""Looks at the queue and at Slurm again and again, and does what the policy makes of it."""

import logging
import threading
import time
from collections.abc import Callable, Collection
from dataclasses import replace

from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.workers import Workers
from plateau.farm.model.errors import StoreUnavailable, WorkerNotFound
from plateau.farm.model.job import Worker
from plateau.scale.policy import Policy
from plateau.scale.report import Report
from plateau.scale.slurm import Slurm, SlurmFailed, label
from plateau.scale.tasks import Look, Plan, TaskState

_LOG = logging.getLogger(__name__)


class Scaler:
    """Submits and ends workers in Slurm as the queue needs them.

    Parameters
    ----------
    jobs, workers
        The farm.
    slurm
        Our tasks.
    policy
        What to do about them.
    pool, tags
        Of the workers.
    from_priority
        Jobs of a lower priority bring no workers; None where all do.
    dry_run
        Say what would be done, and do nothing.
    tell
        Takes the report of each look that found anything new.
    """

    def __init__(
        self,
        jobs: Jobs,
        workers: Workers,
        slurm: Slurm,
        policy: Policy,
        *,
        pool: str,
        tags: Collection[str],
        from_priority: int | None,
        dry_run: bool,
        tell: Callable[[Report], None],
    ) -> None:
        self._jobs = jobs
        self._workers = workers
        self._slurm = slurm
        self._policy = policy
        self._pool = pool
        self._tags = tags
        self._from_priority = from_priority
        self._dry_run = dry_run
        self._tell = tell
        self._told: tuple[object, ...] = ()
        self._variants: set[str] = set()  # that our workers have
        self._labels: set[str] = set()  # of all workers that are, or were, ours

    def run(self, every_s: float, stop: threading.Event) -> None:
        """Look so often, until told to stop; what fails is tried again at the next look."""
        while not stop.is_set():
            try:
                self.step()
            except (SlurmFailed, StoreUnavailable) as error:
                _LOG.error("%s; nothing changes until the next check of the queue", error)
            stop.wait(every_s)

    def step(self) -> None:
        """Look once, and do what is to be done.

        Raises
        ------
        SlurmFailed, StoreUnavailable
            Slurm or Redis cannot be asked, or did not do what it was told to.
        """
        look = self._look()
        plan = self._policy.plan(look)
        array = None if self._dry_run else self._do(plan, look)
        command = self._slurm.submission(plan.submit) if self._dry_run and plan.submit else None
        report = replace(Report.of(look, plan), array=array, command=command)
        if plan.acts or report.news() != self._told:
            self._tell(report)
            self._told = report.news()

    def dismiss_all(self) -> None:
        """Cancel what waits, and ask all others to leave."""
        tasks = self._slurm.tasks()
        waiting = [task.id for task in tasks if task.state is TaskState.WAITS]
        running = [task.id for task in tasks if task.state is TaskState.RUNS]
        if waiting:
            self._slurm.cancel_waiting(waiting)
        if running:
            self._slurm.end(running)
        _LOG.info(
            "%d waiting jobs cancelled, %d workers asked to leave", len(waiting), len(running)
        )

    def _look(self) -> Look:
        tasks = self._slurm.tasks()
        # Of two with one label the one that came last: Slurm has started the task again.
        living = sorted(self._jobs.workers(), key=lambda worker: worker.started_at)
        by_label = {worker.label: worker for worker in living}
        ours = {task.id: by_label[label(task.id)] for task in tasks if label(task.id) in by_label}
        self._labels |= {label(task.id) for task in tasks}
        for worker in ours.values():
            self._variants.update(worker.variants)
        census = self._jobs.census(from_priority=self._from_priority)
        return Look(
            now_s=time.monotonic(),
            demand=census.demand_for(self._variants, pool=self._pool, tags=self._tags),
            tasks=tasks,
            workers=ours,
            others=sum(self._does_the_same(worker) for worker in living),
        )

    def _does_the_same(self, worker: Worker) -> bool:
        """Whether it is somebody else's, and takes work that ours would take."""
        if worker.label in self._labels or worker.drained or worker.trouble is not None:
            return False
        if worker.pool != self._pool:
            return False
        return not self._variants or not self._variants.isdisjoint(worker.variants)

    def _do(self, plan: Plan, look: Look) -> str | None:
        """Do what is planned; returns the id of the array that was submitted."""
        if plan.cancel:
            self._slurm.cancel_waiting(plan.cancel)
        if plan.end:
            self._slurm.end(plan.end)
        for task in plan.drain:
            try:
                self._workers.drain(look.workers[task].id)
            except WorkerNotFound:
                _LOG.info("the worker of Slurm job %s has already gone", task)
        if not plan.submit:
            return None
        try:
            array = self._slurm.submit(plan.submit)
        except SlurmFailed:
            self._policy.note_failure(look.now_s)
            raise
        self._policy.note_submitted(plan.submit)
        return array
