"""The client: all groups of calls over one transport, with those about workers and scenes."""

from collections.abc import Callable
from datetime import date, datetime
from functools import partial
from typing import Any, Final
from urllib.parse import quote

from plateau.client.batches import BatchCalls
from plateau.client.jobs import JobCalls
from plateau.client.results import ResultCalls
from plateau.client.transport import Calls, Transport
from plateau.client.watching import WatchingCalls
from plateau.farm.model.usage import Grouping
from plateau.farm.model.worker import Worker
from plateau.farm.wire.usage_views import Usage
from plateau.farm.wire.views import Scenes, SceneView, TargetNames, Workers

DEFAULT_URL: Final = "http://127.0.0.1:8713"


def _text(time: date | str | None) -> str | None:
    """A time as the service reads it; a `datetime` is a `date`, too."""
    if isinstance(time, datetime):
        return time.isoformat(timespec="seconds")
    return time.isoformat() if isinstance(time, date) else time


class FarmCalls(Calls):
    """Workers and stored scenes."""

    def workers(self) -> list[Worker]:
        """The living workers, and what each renders."""
        return self._transport.read(Workers, "/v1/workers").workers

    def drain(self, worker_id: str) -> Worker:
        """Let the worker finish its slice and take no more; repeating it is harmless.

        Raises
        ------
        ApiError
            ``unknown-worker``; ``role-too-low`` unless the key is an admin's.
        """
        return self._steer_worker(worker_id, "drain")

    def undrain(self, worker_id: str) -> Worker:
        """Let the drained worker take slices again; raises as `drain` does."""
        return self._steer_worker(worker_id, "resume")

    def _steer_worker(self, worker_id: str, action: str) -> Worker:
        path = f"/v1/workers/{quote(worker_id, safe='')}/{action}"
        workers = self._transport.ask(Workers, "POST", path).workers
        return next(worker for worker in workers if worker.id == worker_id)

    def usage(
        self,
        by: Grouping = "week",
        *,
        since: date | str | None = None,
        until: date | str | None = None,
        limit: int | None = None,
    ) -> Usage:
        """What the jobs that were submitted from `since` on and before `until` have cost.

        Raises
        ------
        ApiError
            ``invalid-request``, for example where `until` is not later than `since`.
        """
        asked = {"by": by, "since": _text(since), "until": _text(until), "limit": limit}
        params = {name: str(value) for name, value in asked.items() if value is not None}
        return self._transport.read(Usage, "/v1/usage", params=params)

    def scenes(self) -> list[SceneView]:
        """The stored scenes; `Client.submit` takes one by its SHA-256."""
        return self._transport.read(Scenes, "/v1/scenes").scenes

    def targets(self) -> TargetNames:
        """The targets that a job's notice may name."""
        return self._transport.read(TargetNames, "/v1/targets")


class Client(JobCalls, BatchCalls, WatchingCalls, ResultCalls, FarmCalls):
    """A Plateau service, for Python programs; may be used from several threads.

    Every method raises `ApiError` if the service answers with a problem, `Unreachable` if nothing
    answers for `patience_s` seconds, and `NotPlateau` if the answer is not that of a service.

    Parameters
    ----------
    url
        URL of the service.
    key
        The API key, if the service requires one.
    patience_s
        For how long every call is repeated, safely, while the service is away; 0 for one attempt.
    timeout_s
        Longest time for one answer, but for calls that make jobs, since a scene may be large.
    once_heard_s
        A longer `patience_s` once the service has answered, since it may only be restarting.
    on_version
        Called once with the service's version, when it is known.

    Raises
    ------
    BadUrl, BadKey
        The URL or the key is malformed.
    """

    def __init__(
        self,
        url: str = DEFAULT_URL,
        *,
        key: str | None = None,
        patience_s: float = 10.0,
        timeout_s: float = 30.0,
        once_heard_s: float = 0.0,
        on_version: Callable[[str], object] | None = None,
    ) -> None:
        options: dict[str, Any] = {
            "key": key,
            "patience_s": patience_s,
            "timeout_s": timeout_s,
            "once_heard_s": once_heard_s,
            "on_version": on_version,
        }
        self._transport = Transport(url, **options)
        # A function, so that no print of the client's attributes shows the key.
        self._made_again: Callable[[], partial[Client]] = lambda: partial(
            type(self), self.url, **options
        )
        self._transport.whole_id = self.whole_id

    def __reduce__(self) -> tuple[Any, ...]:
        """A pickled client has the API key, and opens connections of its own."""
        return self._made_again(), ()

    @property
    def url(self) -> str:
        """URL of the service, without a slash at its end."""
        return self._transport.url

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._transport.close()
