"""Several jobs advance side by side in one thread, and share round trips to Redis.

A job's code asks for one thing after another. Each answer takes a round trip and, after a write,
Redis's wait for its disk, so a monitor of many jobs would wait more than it works.
"""

from collections.abc import Callable, Iterable, Sequence
from contextvars import copy_context
from itertools import islice
from typing import Any, Final, NamedTuple, cast

from greenlet import getcurrent, greenlet

from plateau.farm.redis.client import Pipeline, RedisClient

#: The most tasks that have begun and not ended. Their requests go in one round trip.
AT_ONCE: Final = 16


class _Request(NamedTuple):
    """A call of a method of redis-py's pipeline."""

    method: str
    arguments: tuple[Any, ...]
    options: dict[str, Any]


class SideBySide:
    """Runs tasks in one thread as greenlets: each has its turn until it asks Redis.

    A task has an answer only when its command is done, so it is written as if it were alone. The
    commands of one task keep their order; those of other tasks and clients may run between them.
    """

    def __init__(self, client: RedisClient) -> None:
        self._redis = client
        #: The client for tasks. It answers at once whoever asks outside of a task.
        self.client = cast(RedisClient, _SharedClient(client))

    def run(self, tasks: Iterable[Callable[[], None]]) -> None:
        """Run the tasks, and return when all have ended.

        An exception of a task is raised, and ends the other tasks where they are.
        """
        coming, begun = iter(tasks), dict[greenlet, Sequence[_Request]]()
        try:
            while True:
                while len(begun) < AT_ONCE and (work := next(coming, None)):
                    task = greenlet(work)
                    task.gr_context = copy_context()
                    _resume(task, begun)
                if not begun:
                    return
                answers = iter(self._answers([one for asked in begun.values() for one in asked]))
                for task, asked in list(begun.items()):
                    _resume(task, begun, list(islice(answers, len(asked))))
        finally:
            for task in begun:
                task.throw()

    def _answers(self, requests: Sequence[_Request]) -> Sequence[Any]:
        """The answers to the requests, of one round trip: values, and exceptions."""
        pipe = self._redis.pipeline(transaction=False)
        for method, arguments, options in requests:
            getattr(pipe, method)(*arguments, **options)
        try:
            return pipe.execute(raise_on_error=False)
        except Exception as error:  # noqa: BLE001  (each task gets it in the place of its answer)
            return [error] * len(requests)


def _resume(
    task: greenlet, begun: dict[greenlet, Sequence[_Request]], *given: Sequence[Any]
) -> None:
    """Let the task begin, or continue with these answers, until it asks or ends."""
    begun.pop(task, None)
    asked = task.switch(*given)
    if not task.dead:
        begun[task] = asked


def _hub() -> greenlet | None:
    """Who runs the current task; None outside of a task."""
    return getcurrent().parent


def _answers_to(requests: Sequence[_Request]) -> list[Any]:
    """Return the answers to the current task's requests; raises the first that is an exception."""
    hub = _hub()
    assert hub is not None
    answers: list[Any] = hub.switch(requests)
    for answer in answers:
        if isinstance(answer, Exception):
            raise answer
    return answers


class _SharedClient:
    """A Redis client that hands a task's requests to the one who runs the tasks."""

    def __init__(self, client: RedisClient) -> None:
        self._redis = client

    def __getattr__(self, method: str) -> Callable[..., Any]:
        if _hub() is None:
            direct: Callable[..., Any] = getattr(self._redis, method)
            return direct
        return lambda *arguments, **options: _answers_to([_Request(method, arguments, options)])[0]

    def pipeline(self, transaction: bool = True) -> Pipeline:
        if transaction or _hub() is None:
            return self._redis.pipeline(transaction)
        return cast(Pipeline, _SharedPipeline())


class _SharedPipeline:
    """Requests of one task that go together."""

    def __init__(self) -> None:
        self._requests: list[_Request] = []

    def __getattr__(self, method: str) -> Callable[..., None]:
        return lambda *arguments, **options: self._requests.append(
            _Request(method, arguments, options)
        )

    def execute(self) -> list[Any]:
        return _answers_to(self._requests)
