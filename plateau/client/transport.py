"""Requests to the service, repeated while it is away, and answers read into models."""

import math
import re
import ssl
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final, TypeVar

import httpx
from pydantic import BaseModel, ValidationError

from plateau.client.errors import ApiError, BadKey, BadUrl, ClientError, NotPlateau, Unreachable
from plateau.farm.process.backoff import Backoff

_FIRST_WAIT_S: Final = 0.25
_LONGEST_WAIT_S: Final = 5.0
_CONNECT_S: Final = 5.0
#: How long the service may take to take up a part of an upload.
_WRITE_S: Final = 120.0
_VERSION: Final = "Plateau-Version"
#: Statuses after which the same call may succeed in a moment.
_AWAY: Final = frozenset({httpx.codes.SERVICE_UNAVAILABLE, httpx.codes.TOO_MANY_REQUESTS})
#: What the system puts before an error's words, for programs.
_ERRNO: Final = re.compile(r"^\[Errno -?\d+\] ")

_Model = TypeVar("_Model", bound=BaseModel)


class Patience:
    """Waits between the attempts of one call, longer and longer, until it is out of time.

    How long that is it asks each time, for who was heard once is waited for longer.
    """

    def __init__(self, transport: "Transport") -> None:
        self._transport = transport
        self.renew()

    def renew(self) -> None:
        """Begin anew: the service was heard."""
        self._started = time.monotonic()
        self._backoff = Backoff(_FIRST_WAIT_S, _LONGEST_WAIT_S)

    def wait_after(self, error: ClientError, *, at_most_s: float = math.inf) -> None:
        """Wait before the next attempt, or raise the error where there should be none."""
        asked_s = error.retry_after_s if isinstance(error, ApiError) else 0.0
        spent_s = time.monotonic() - self._started
        if not _is_away(error) or spent_s + asked_s > self._transport.patience_s:
            raise error
        time.sleep(max(0.0, min(max(self._backoff.delay_s(), asked_s), at_most_s)))


class Transport:
    """The connections to one service; may be used from several threads.

    Parameters
    ----------
    url
        Where the service is.
    key
        The API key to show it; None for none.
    patience_s
        For how long a call is repeated while the service is away.
    once_heard_s
        The same, once it was heard; it is then at least `patience_s`.
    timeout_s
        For how long an answer may take.
    on_version
        Called with the version of the service, as soon as that is known.

    Attributes
    ----------
    version
        The version of the service; None where it has not said.
    """

    def __init__(
        self,
        url: str,
        *,
        key: str | None,
        patience_s: float,
        timeout_s: float,
        once_heard_s: float = 0.0,
        on_version: Callable[[str], object] | None = None,
    ) -> None:
        self.url = _checked(url)
        self.version: str | None = None
        self._on_version = on_version
        self._patience_s = patience_s
        self._once_heard_s = once_heard_s
        self._is_heard = False
        timeout = httpx.Timeout(timeout_s, connect=min(timeout_s, _CONNECT_S), write=_WRITE_S)
        # The service is on this machine, or in a tunnel to it: never behind a proxy.
        self._http = httpx.Client(
            base_url=self.url,
            timeout=timeout,
            trust_env=False,
            headers=_authorization(key),
            verify=_trusted(self.url),
            event_hooks={"response": [self._heard]},
        )

    @property
    def patience_s(self) -> float:
        """For how long a call is repeated while the service is away."""
        return max(self._patience_s, self._once_heard_s if self._is_heard else 0.0)

    def close(self) -> None:
        """Give the connections back."""
        self._http.close()

    def _heard(self, answer: httpx.Response) -> None:
        self._is_heard = self._is_heard or answer.is_success
        version = answer.headers.get(_VERSION)
        if version is not None and self.version is None:
            self.version = version
            if self._on_version is not None:
                self._on_version(version)

    def read(self, kind: type[_Model], path: str, **arguments: Any) -> _Model:
        """What a GET of the path answers, as a model of this kind."""
        return self.understood(kind, self.send("GET", path, **arguments))

    def understood(self, kind: type[_Model], answer: httpx.Response) -> _Model:
        """The answer as a model of this kind, or `NotPlateau`.

        What a newer service has added is left out.
        """
        try:
            return kind.model_validate_json(answer.content, extra="ignore")
        except ValidationError as error:
            raise NotPlateau(self.url, f"its {kind.__name__} cannot be read") from error

    def send(self, method: str, path: str, **arguments: Any) -> httpx.Response:
        """The answer to a request, which is repeated while the service is away.

        So it must be safe to repeat. `arguments` are those of `httpx.Client.request`.

        Raises
        ------
        ApiError, NotPlateau, Unreachable
        """
        return self._repeated(lambda: self._http.request(method, path, **arguments))

    @contextmanager
    def stream(
        self, path: str, *, read_s: float, headers: dict[str, str] | None = None
    ) -> Iterator[httpx.Response]:
        """A response whose body is read as it comes, with at most `read_s` between its parts."""
        timeout = httpx.Timeout(read_s, connect=min(read_s, _CONNECT_S))
        with (
            self._reached(),
            self._http.stream("GET", path, headers=headers, timeout=timeout) as answer,
        ):
            if answer.is_error:
                answer.read()
                raise self._error(answer)
            yield answer

    def _repeated(self, send: Callable[[], httpx.Response]) -> httpx.Response:
        patience = Patience(self)
        while True:
            try:
                with self._reached():
                    answer = send()
                if not answer.is_success:
                    raise self._error(answer)
            except ClientError as error:
                patience.wait_after(error)
            else:
                return answer

    @contextmanager
    def _reached(self) -> Iterator[None]:
        try:
            yield
        except httpx.TimeoutException as error:
            raise Unreachable(self.url, str(error) or "it is silent") from error
        except httpx.TransportError as error:
            raise Unreachable(self.url, _ERRNO.sub("", str(error))) from error

    def _error(self, answer: httpx.Response) -> ClientError:
        try:
            problem = answer.json()
        except ValueError:
            problem = None
        if isinstance(problem, dict) and "type" in problem:
            retry_after_s = _seconds(answer.headers.get("Retry-After"))
            error = ApiError(answer.status_code, problem, retry_after_s=retry_after_s)
            # It is there and has too much to do, so it is waited for.
            self._is_heard = self._is_heard or error.slug == "busy"
            return error
        if answer.status_code in _AWAY:  # a proxy in front of a service that is away
            return ApiError(answer.status_code, {})
        return NotPlateau(self.url, f"HTTP status {answer.status_code}")


class Calls:
    """Calls over one transport; `plateau.client.Client` is made of such groups.

    Every method raises `ApiError` where the service answers with a problem, `Unreachable` where
    nothing answers for as long as the client is patient, and `NotPlateau` where what answers is
    something else. Other errors, and the problems to reckon with, are with the method.
    """

    _transport: Transport


def _checked(url: str) -> str:
    try:
        parsed = httpx.URL(url)
    except httpx.InvalidURL:
        raise BadUrl(url) from None
    if parsed.scheme not in {"http", "https"} or not parsed.host or " " in url:
        raise BadUrl(url)
    return url.rstrip("/")


def _authorization(key: str | None) -> dict[str, str]:
    if key is None:
        return {}
    if not (key.isascii() and key.isprintable() and " " not in key):
        raise BadKey
    return {"Authorization": f"Bearer {key}"}


def _trusted(url: str) -> ssl.SSLContext | bool:
    """Whose certificates are believed: those whom this machine trusts, and SSL_CERT_FILE's.

    By plain HTTP nobody shows any, and redirects are not followed: none are read then, in 40 ms.
    """
    return ssl.create_default_context() if url.startswith("https:") else False


def _seconds(header: str | None) -> float:
    return float(header) if header is not None and header.isascii() and header.isdigit() else 0.0


def _is_away(error: ClientError) -> bool:
    """Whether the same call may succeed in a moment."""
    return isinstance(error, Unreachable) or (isinstance(error, ApiError) and error.status in _AWAY)
