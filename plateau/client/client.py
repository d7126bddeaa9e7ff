"""The client: all groups of calls over one transport."""

from collections.abc import Callable
from functools import cached_property
from types import TracebackType
from typing import TYPE_CHECKING, Final

from plateau.client.batches import BatchCalls
from plateau.client.continuing import ContinuingCalls
from plateau.client.farm_calls import FarmCalls, WebhookCalls
from plateau.client.jobs import JobCalls
from plateau.client.results import ResultCalls
from plateau.client.transport import Transport
from plateau.client.watching import WatchingCalls

if TYPE_CHECKING:
    from plateau.study.client import StudyCalls

DEFAULT_URL: Final = "http://127.0.0.1:8713"


class Client(
    JobCalls,
    ContinuingCalls,
    BatchCalls,
    WatchingCalls,
    ResultCalls,
    WebhookCalls,
    FarmCalls,
):
    """A Plateau service, as a Python program sees it; may be used from several threads.

    Every method raises `ApiError` where the service answers with a problem, `Unreachable` where
    nothing answers for `patience_s` seconds, and `NotPlateau` where what answers is something else.

    Parameters
    ----------
    url
        Where the service is.
    key
        The API key to show it, where it wants one.
    patience_s
        For how long a call is repeated while the service is away; 0 for one attempt. Every call
        may be repeated safely.
    timeout_s
        For how long one answer may take.
    once_heard_s
        As `patience_s`, for a service that has answered before: it is being started again, say.
    on_version
        Called with the service's version, once, when it is known.

    Raises
    ------
    BadUrl
        The URL cannot be that of a service.
    BadKey
        The key cannot be one.
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
        self._transport = Transport(
            url,
            key=key,
            patience_s=patience_s,
            timeout_s=timeout_s,
            once_heard_s=once_heard_s,
            on_version=on_version,
        )

    @cached_property
    def studies(self) -> "StudyCalls":
        """Calls about observer studies, over the same connections."""
        from plateau.study.client import StudyCalls

        return StudyCalls(self._transport)

    @property
    def url(self) -> str:
        """Where the service is, without a slash at its end."""
        return self._transport.url

    @property
    def service_version(self) -> str | None:
        """The version of the service; None before it has answered, and where it is too old."""
        return self._transport.version

    def __enter__(self) -> "Client":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Give the connections back."""
        self._transport.close()
