"""The report of a snapshot and its plan: a line for people, or JSON for programs."""

import json
from dataclasses import asdict, dataclass

from plateau.farm.model.job import utc_now
from plateau.scale.tasks import ScalingPlan, Snapshot, TaskState


@dataclass(frozen=True, kw_only=True)
class Report(ScalingPlan):
    """One snapshot and its plan."""

    waiting: int  #: tasks that wait for a machine
    waiting_for: tuple[str, ...]  #: the batch system's reasons
    running: int  #: tasks that run
    rendering: int  #: workers that render
    silent: int  #: running tasks without a heartbeat of their worker yet
    others: int  #: workers that are not ours
    slices: int  #: slices to render
    work_s: float  #: time that one worker would need for them
    array: str | None = None  #: id of the submitted array
    command: tuple[str, ...] | None = None  #: of a dry run: the command that would submit it

    @classmethod
    def of(cls, snapshot: Snapshot, plan: ScalingPlan) -> "Report":
        """The report before anything is done."""
        waiting = [task for task in snapshot.tasks if task.state is TaskState.WAITS]
        running = [task for task in snapshot.tasks if task.state is TaskState.RUNS]
        return cls(
            **{**asdict(plan), "held_s": round(plan.held_s, 1)},
            waiting=len(waiting),
            waiting_for=tuple(sorted({task.why for task in waiting})),
            running=len(running),
            rendering=sum(worker.job is not None for worker in snapshot.workers.values()),
            silent=sum(task.id not in snapshot.workers for task in running),
            others=snapshot.others,
            slices=snapshot.demand.slices,
            work_s=round(snapshot.demand.work_s, 1),
        )

    def news(self) -> tuple[object, ...]:
        """The fields whose change is worth a line; the others change all the time."""
        return (
            *(self.wanted, self.have, self.waiting, self.waiting_for, self.running, self.silent),
            *(self.others, self.held_s > 0),
        )

    def as_json(self) -> str:
        """All fields and the time, on one line."""
        now = utc_now().isoformat(timespec="milliseconds")
        return json.dumps({"time": now, **asdict(self)})

    def in_words(self) -> str:
        """The report as a sentence, without the zeros."""
        there = (
            (self.waiting, f"waiting ({', '.join(self.waiting_for)})"),
            (self.running, "running"),
            (self.rendering, "rendering"),
            (self.silent, "not yet heard from"),
        )
        done = (
            (len(self.cancel), f"cancelled: {', '.join(self.cancel)}"),
            (len(self.drain), f"drained: {', '.join(self.drain)}"),
            (len(self.end), f"asked to leave: {', '.join(self.end)}"),
            (self.submit, f"submitted as {self.array}" if self.array else "to be submitted"),
        )
        needed = f"{_workers(self.wanted)} needed for {self.work_s:g} s of work"
        parts = [
            f"{needed}, {self.have} there or coming",
            ", ".join(f"{count} {what}" for count, what in there if count),
            f"{_workers(self.others)} from elsewhere" if self.others else "",
            *(f"{count} {what}" for count, what in done if count),
            f"nothing is submitted for {self.held_s:g} s, because the last try brought no "
            "working worker; the logs of Slurm and of the worker say why"
            if self.held_s
            else "",
            " ".join(self.command) if self.command else "",
        ]
        return "; ".join(part for part in parts if part)


def _workers(count: int) -> str:
    return "1 worker" if count == 1 else f"{count} workers"
