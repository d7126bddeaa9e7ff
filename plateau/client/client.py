"""The client: all groups of calls over one transport."""

from collections.abc import Callable
from functools import partial
from typing import Any, Final

from plateau.client.batches import BatchCalls
from plateau.client.farm_calls import FarmCalls
from plateau.client.jobs import JobCalls
from plateau.client.results import ResultCalls
from plateau.client.transport import Transport
from plateau.client.watching import WatchingCalls

DEFAULT_URL: Final = "http://127.0.0.1:8713"


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
        Longest time for one answer.
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
