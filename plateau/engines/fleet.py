"""The workers of one run: as many as were asked for, for as long as the run lasts."""

import threading
from collections import Counter
from collections.abc import Callable, Sequence
from queue import SimpleQueue
from typing import Final

from plateau.engines.contract import Crew, Engine, Task, TaskState
from plateau.engines.front import Front
from plateau.errors import CommandFailed, PlateauError
from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.model.worker import Worker
from plateau.farm.process.waits import Backoff

#: Between two looks at the batch system, which answers everybody: longer while nothing changes.
_LOOK_S: Final = (0.5, 15.0)
#: A worker that fails is replaced this often in a run, and once more for each that was asked for.
_REPLACED: Final = 3
_PATIENCE_S: Final = 5.0

_THERE: Final = (TaskState.WAITS, TaskState.RUNS)


class Fleet:
    """Keeps an engine's workers at a number, in a thread; a context, which gives all nodes back.

    A worker whose node was taken away, died, or reached a time limit is replaced. So is one that
    failed, a few times.

    Parameters
    ----------
    engine, front, crew
        What brings the workers, where they report, and what they are.
    wanted
        Number of workers.
    living
        The workers whose heartbeats are heard; may raise `StoreUnavailable`.
    """

    def __init__(
        self,
        engine: Engine,
        front: Front,
        crew: Crew,
        wanted: int,
        living: Callable[[], Sequence[Worker]],
    ) -> None:
        self._engine, self._front, self._python = engine, front, crew.python
        self._wanted, self._living = wanted, living
        self._over = threading.Event()
        self._asking = threading.Lock()  # no worker is asked for after `give_back`
        self._thread = threading.Thread(target=self._keep, name="fleet", daemon=True)
        self._error: Exception | None = None
        self._notes: SimpleQueue[str] = SimpleQueue()
        self._seen: tuple[Task, ...] = ()
        self._summary = ""  # that was told last
        self._told: set[str] = set()
        self.heard = False  #: of any worker: so the nodes can work
        self._ended: dict[str, Task] = {}

    def __enter__(self) -> "Fleet":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.give_back()

    def check(self, tell: Callable[[str], None]) -> None:
        """Pass on the news; raise the error after which there will be no worker."""
        while not self._notes.empty():
            tell(self._notes.get())
        if self._error is not None and not self._over.is_set():
            raise self._error

    def give_back(self) -> None:
        """End all workers at once, and ask for none any more; in any thread, as often as it may."""
        with self._asking:
            if not self._over.is_set():
                self._over.set()
                self._engine.release()
        self._thread.join(_PATIENCE_S)

    def _keep(self) -> None:
        try:
            self._ask(self._wanted)
            backoff = Backoff(*_LOOK_S)
            while not self._over.wait(backoff.delay_s()):
                try:
                    found = tuple(self._engine.tasks())
                except PlateauError as error:
                    self._tell(f"{error}; trying again")
                    continue
                if found != self._seen:
                    backoff.reset()
                self._look(found)
        except Exception as error:  # noqa: BLE001  (`check` raises it in the other thread)
            self._error = error

    def _ask(self, count: int) -> None:
        with self._asking:
            if not self._over.is_set():
                self._engine.ask(count)

    def _look(self, found: tuple[Task, ...]) -> None:
        """Say what has changed, and replace the workers that have gone."""
        if self._over.is_set():
            return
        try:
            workers = self._living()
        except StoreUnavailable:
            return
        self.heard = self.heard or bool(workers)
        for line in {f"{one.host}: {one.trouble}" for one in workers if one.trouble}:
            self._tell(line)
        news = [task for task in found if task.state not in _THERE and task.id not in self._ended]
        self._ended.update((task.id, task) for task in news)
        there = [task for task in found if task.state in _THERE]
        runs = [task for task in there if task.state is TaskState.RUNS]
        failed = self._of(TaskState.FAILED)
        if failed and not runs and not self.heard:
            raise CommandFailed(f"no node can work for this run: {self._why(failed[0])}")
        for task in news:
            if task.state is TaskState.FAILED:
                self._notes.put(self._why(task))
        lost = len(self._of(TaskState.CANCELLED)) + max(
            0, len(failed) - _REPLACED - self._wanted if self.heard else len(failed)
        )
        if lost >= self._wanted and not there:
            raise CommandFailed(
                f"no worker is left: {self._why(failed[-1])}"
                if failed
                else "somebody cancelled all workers of this run"
            )
        summary = _summary(there, runs, self._wanted)
        if found == self._seen and summary != self._summary:  # it has lasted
            self._notes.put(summary)
            self._summary = summary
        self._seen = found
        missing = self._wanted - len(there) - lost
        if missing > 0:
            try:
                self._ask(missing)
            except PlateauError as error:
                self._tell(f"{error}; trying again")

    def _of(self, state: TaskState) -> list[Task]:
        return [task for task in self._ended.values() if task.state is state]

    def _why(self, task: Task) -> str:
        words = f" ({task.why})" if task.why else ""
        return f"{task.node or task.id}: {self._front.unfit(task.code, self._python)}{words}"

    def _tell(self, line: str) -> None:
        """Pass a line on, once."""
        if line not in self._told:
            self._told.add(line)
            self._notes.put(line)


def _summary(there: Sequence[Task], runs: Sequence[Task], wanted: int) -> str:
    """How many workers run, and what the others wait for."""
    reasons = Counter(task.why for task in there if task.state is TaskState.WAITS)
    waits = ", ".join(
        f"{count} wait{'s' * (count == 1)} ({why})" if why else f"{count} to come"
        for why, count in reasons.most_common()
    )
    return f"nodes: {len(runs)} of {wanted} workers run{f'; {waits}' if waits else ''}"
