"""What a look found and what was done about it: a line for people, or for programs."""

import json
from dataclasses import asdict, dataclass
from datetime import datetime, timezone

from plateau.scale.tasks import Look, Plan, TaskState


@dataclass(frozen=True, kw_only=True)
class Report:
    """One look. A task is a job of the batch system; it brings a worker."""

    wanted: int  #: tasks
    have: int  #: that are at work, or will be
    waiting: int  #: tasks, for a machine
    waiting_for: tuple[str, ...]  #: in the batch system's words
    running: int  #: tasks
    rendering: int  #: of their workers
    silent: int  #: tasks that run, and whose worker was not heard of yet
    others: int  #: workers that are somebody else's
    slices: int  #: that want a worker
    work_s: float  #: for one worker
    submit: int
    cancel: tuple[str, ...]
    drain: tuple[str, ...]
    end: tuple[str, ...]
    held_s: float
    array: str | None = None  #: what was submitted
    command: tuple[str, ...] | None = None  #: or would be

    @classmethod
    def of(cls, look: Look, plan: Plan) -> "Report":
        """What there is, and is to be done."""
        waiting = [task for task in look.tasks if task.state is TaskState.WAITS]
        running = [task for task in look.tasks if task.state is TaskState.RUNS]
        return cls(
            wanted=plan.wanted,
            have=plan.have,
            waiting=len(waiting),
            waiting_for=tuple(sorted({task.why for task in waiting})),
            running=len(running),
            rendering=sum(worker.job is not None for worker in look.workers.values()),
            silent=sum(task.id not in look.workers for task in running),
            others=look.others,
            slices=look.demand.slices,
            work_s=round(look.demand.work_s, 1),
            submit=plan.submit,
            cancel=plan.cancel,
            drain=plan.drain,
            end=plan.end,
            held_s=round(plan.held_s, 1),
        )

    def news(self) -> tuple[object, ...]:
        """What is worth a line when it changes: not what goes up and down all the time."""
        return (
            *(self.wanted, self.have, self.waiting, self.waiting_for, self.running, self.silent),
            *(self.others, self.held_s > 0),
        )

    def as_json(self) -> str:
        """All of it, with the time, on one line."""
        now = datetime.now(timezone.utc).isoformat(timespec="milliseconds")
        return json.dumps({"time": now, **asdict(self)})

    def in_words(self) -> str:
        """The same for people, without what is nought."""
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
            f"nothing is submitted for {self.held_s:g} s, since the last try brought no "
            "worker that works; Slurm's log and the worker's say why"
            if self.held_s
            else "",
            " ".join(self.command) if self.command else "",
        ]
        return "; ".join(part for part in parts if part)


def _workers(count: int) -> str:
    return "1 worker" if count == 1 else f"{count} workers"
