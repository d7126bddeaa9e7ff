"""The client for asyncio: every call of `Client`, awaited.

Each call is that of `Client`, made in a thread of its own: there is one code path for both, and
the event loop never waits for packing, hashing or the disk.
"""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from functools import partial, wraps
from typing import Any, Concatenate, Final, ParamSpec, TypeVar

from plateau.client.client import DEFAULT_URL, Client
from plateau.farm.model.job import Event
from plateau.farm.wire.views import JobView

_P = ParamSpec("_P")
_T = TypeVar("_T")

_END: Final = object()


async def _in_thread(call: Callable[[], _T]) -> _T:
    """The result of a call that another thread makes; a call that nobody awaits any more ends."""
    loop = asyncio.get_running_loop()
    done: asyncio.Future[_T] = loop.create_future()

    def tell(set_it: Callable[[Any], None], what: object) -> None:
        if not done.cancelled():
            set_it(what)

    def run() -> None:
        try:
            result = call()
        except BaseException as error:  # noqa: BLE001  (raised where it is awaited)
            _in_loop(loop, tell, done.set_exception, error)
        else:
            _in_loop(loop, tell, done.set_result, result)

    # No pool: a call that waits for a job would keep others from running.
    threading.Thread(target=run, name="plateau-client", daemon=True).start()
    return await done


def _in_loop(loop: asyncio.AbstractEventLoop, call: Callable[..., object], *args: object) -> None:
    """Call a function in the event loop, unless that has been closed."""
    if not loop.is_closed():
        loop.call_soon_threadsafe(call, *args)


def _awaited(
    call: Callable[Concatenate[Client, _P], _T],
) -> Callable[Concatenate["AsyncClient", _P], Coroutine[Any, Any, _T]]:
    """A call of `Client` to be awaited."""

    @wraps(call)
    async def method(self: "AsyncClient", /, *args: _P.args, **kwargs: _P.kwargs) -> _T:
        return await _in_thread(partial(call, self.blocking, *args, **kwargs))

    return method


def _iterated(
    call: Callable[Concatenate[Client, _P], Iterator[_T]],
) -> Callable[Concatenate["AsyncClient", _P], AsyncIterator[_T]]:
    """A call of `Client` to be iterated by ``async for``."""

    @wraps(call)
    async def method(self: "AsyncClient", /, *args: _P.args, **kwargs: _P.kwargs) -> Any:
        values = call(self.blocking, *args, **kwargs)
        while (value := await _in_thread(partial(next, values, _END))) is not _END:
            yield value

    return method


class AsyncClient:
    """A Plateau service, for programs with asyncio: the calls of `Client`, with its errors.

    `Client` documents the calls. Those that return an iterator there return an asynchronous one
    here. A cancelled call is not awaited any more, while its thread may still wait for the service.

    Parameters
    ----------
    url, key, patience_s, timeout_s
        Those of `Client`.

    Examples
    --------
    >>> async def main():
    ...     async with AsyncClient() as client:
    ...         jobs = [await client.submit("scenes:box", seed=seed) for seed in range(4)]
    ...         await asyncio.gather(*(client.wait(job.id) for job in jobs))
    """

    def __init__(
        self,
        url: str = DEFAULT_URL,
        *,
        key: str | None = None,
        patience_s: float = 10.0,
        timeout_s: float = 30.0,
    ) -> None:
        #: what makes the calls
        self.blocking: Final = Client(url, key=key, patience_s=patience_s, timeout_s=timeout_s)

    async def __aenter__(self) -> "AsyncClient":
        return self

    async def __aexit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self.blocking.close()

    again = _awaited(Client.again)
    all_batches = _iterated(Client.all_batches)
    all_jobs = _iterated(Client.all_jobs)
    array = _awaited(Client.array)
    batch = _awaited(Client.batch)
    batches = _awaited(Client.batches)
    cancel = _awaited(Client.cancel)
    cancel_batch = _awaited(Client.cancel_batch)
    channels = _awaited(Client.channels)
    curve = _awaited(Client.curve)
    curve_columns = _awaited(Client.curve_columns)
    curve_csv = _awaited(Client.curve_csv)
    delete = _awaited(Client.delete)
    delete_batch = _awaited(Client.delete_batch)
    download = _awaited(Client.download)
    drain = _awaited(Client.drain)
    events = _iterated(Client.events)
    film = _awaited(Client.film)
    happened = _awaited(Client.happened)
    image = _awaited(Client.image)
    job = _awaited(Client.job)
    jobs = _awaited(Client.jobs)
    log = _awaited(Client.log)
    pause = _awaited(Client.pause)
    pause_batch = _awaited(Client.pause_batch)
    restore = _awaited(Client.restore)
    restore_batch = _awaited(Client.restore_batch)
    resume = _awaited(Client.resume)
    resume_batch = _awaited(Client.resume_batch)
    scenes = _awaited(Client.scenes)
    targets = _awaited(Client.targets)
    set_priority = _awaited(Client.set_priority)
    shot = _awaited(Client.shot)
    slices = _awaited(Client.slices)
    submit = _awaited(Client.submit)
    submit_batch = _awaited(Client.submit_batch)
    undrain = _awaited(Client.undrain)
    usage = _awaited(Client.usage)
    usage_csv = _awaited(Client.usage_csv)
    wait_for_batch = _awaited(Client.wait_for_batch)
    whole_id = _awaited(Client.whole_id)
    workers = _awaited(Client.workers)

    async def wait(
        self,
        job_id: str,
        *,
        timeout_s: float | None = None,
        on_event: Callable[[Event], object] | None = None,
    ) -> JobView:
        """The job once it is finished, as `Client.wait` has it.

        `on_event` is called in the event loop.
        """
        async for event in self.events(job_id, timeout_s=timeout_s):
            if on_event is not None:
                on_event(event)
        return await self.job(job_id)
