"""Requests to the service, repeated while it is away, and answers parsed into models."""

import math
import re
import socket
import ssl
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final, TypeVar

import httpx
from pydantic import BaseModel, ValidationError
from pydantic_core import to_jsonable_python

from plateau.client.errors import (
    ApiError,
    BadKey,
    BadUrl,
    ClientError,
    NotPlateau,
    Unreachable,
    api_error,
)
from plateau.farm.process.waits import Backoff

_FIRST_WAIT_S: Final = 0.25
_LONGEST_WAIT_S: Final = 5.0
_CONNECT_S: Final = 5.0
#: Longest time for the service to accept a part of an upload.
_WRITE_S: Final = 120.0
_MAKING_S: Final = 4 * 3600.0  #: how long a service may read, check and store a scene
#: Notices in two minutes that the other machine is gone, see tcp(7).
_KEEP_ALIVE: Final = (
    (socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1),
    *(
        (socket.IPPROTO_TCP, getattr(socket, name), value)
        for name, value in (("TCP_KEEPIDLE", 60), ("TCP_KEEPINTVL", 15), ("TCP_KEEPCNT", 4))
        if hasattr(socket, name)
    ),
)
_VERSION: Final = "Plateau-Version"
#: Statuses after which the same call may succeed in a moment.
_AWAY: Final = frozenset({429, 502, 503, 504})

#: The beginning of a path of a job's, and the id.
_OF_A_JOB: Final = re.compile(r"^(/v1/jobs/)([^/]+)")

Model = TypeVar("Model", bound=BaseModel)


class Patience:
    """Waits between the attempts of one call, longer each time, until its time is over.

    It asks the transport for that time before each wait: an answer in between extends it.
    """

    def __init__(self, transport: "Transport") -> None:
        self._transport = transport
        self.renew()

    def renew(self) -> None:
        """Start the time anew, because the service has answered."""
        self._started = time.monotonic()
        self._backoff = Backoff(_FIRST_WAIT_S, _LONGEST_WAIT_S)

    def wait_after(self, error: ClientError, *, at_most_s: float = math.inf) -> None:
        """Wait before the next attempt; raise the error if there should be none."""
        asked_s = error.retry_after_s if isinstance(error, ApiError) else 0.0
        spent_s = time.monotonic() - self._started
        if not _is_away(error) or spent_s + asked_s > self._transport.patience_s:
            raise error
        time.sleep(max(0.0, min(max(self._backoff.delay_s(), asked_s), at_most_s)))


class Transport:
    """The connections to one service; parameters and properties are those of `Client`."""

    def __init__(
        self,
        url: str,
        *,
        key: str | None,
        patience_s: float,
        timeout_s: float,
        once_heard_s: float,
        on_version: Callable[[str], object] | None,
    ) -> None:
        self.url = _checked(url)
        #: makes a shortened id in a path whole
        self.whole_id: Callable[[str], str] = str
        self._on_version = on_version
        self._patience_s = patience_s
        self.once_heard_s = once_heard_s
        self._is_heard = False
        timeout = httpx.Timeout(timeout_s, connect=min(timeout_s, _CONNECT_S), write=_WRITE_S)
        self._long_timeout = httpx.Timeout(_MAKING_S, connect=timeout.connect, write=_WRITE_S)
        # No proxy of the environment: the service is on this machine or at the end of a tunnel.
        self._http = httpx.Client(
            base_url=self.url,
            timeout=timeout,
            trust_env=False,
            headers=_authorization(key),
            transport=httpx.HTTPTransport(
                verify=_trusted(self.url),
                limits=httpx.Limits(max_connections=None),  # a data set has a stream for each job
                socket_options=_KEEP_ALIVE,
            ),
            event_hooks={"response": [self._heard]},
        )

    @property
    def patience_s(self) -> float:
        """For how long a call is repeated while the service is away."""
        return max(self._patience_s, self.once_heard_s if self._is_heard else 0.0)

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def _heard(self, answer: httpx.Response) -> None:
        self._is_heard = self._is_heard or answer.is_success
        version = answer.headers.get(_VERSION)
        if version is not None and self._on_version is not None:
            tell, self._on_version = self._on_version, None
            tell(version)

    def read(self, kind: type[Model], path: str, **arguments: Any) -> Model:
        """The answer to a GET of the path, as `ask` parses it."""
        return self.ask(kind, "GET", path, **arguments)

    def ask(self, kind: type[Model], method: str, path: str, **arguments: Any) -> Model:
        """The answer to a request as a model of this kind; fields of newer services are left out.

        The request is repeated like that of `send`.
        """
        answer = self.send(method, path, **arguments)
        try:
            return kind.model_validate_json(answer.content)
        except ValidationError as error:
            raise NotPlateau(self.url, f"its {kind.__name__} cannot be read") from error

    def make(self, kind: type[Model], path: str, **arguments: Any) -> Model:
        """The answer to a POST that makes a job, as `ask` parses it: a large scene takes long."""
        return self.ask(kind, "POST", path, timeout=self._long_timeout, **arguments)

    def send(self, method: str, path: str, **arguments: Any) -> httpx.Response:
        """The answer to a request, which is repeated while the service is away.

        The request must be safe to repeat. `arguments` are those of `httpx.Client.request`. Raises
        `ApiError`, `NotPlateau` or `Unreachable`.
        """
        path = self._with_whole_id(path)
        if "json" in arguments:
            # Numbers of numpy are numbers, and parts of a spec objects.
            plain = to_jsonable_python(arguments["json"], fallback=lambda one: one.item())
            arguments["json"] = plain
        patience = Patience(self)
        while True:
            try:
                with self._reached():
                    answer = self._http.request(method, path, **arguments)
                if not answer.is_success:
                    raise self._error(answer)
            except ClientError as error:
                patience.wait_after(error)
            else:
                return answer

    @contextmanager
    def stream(
        self, path: str, *, read_s: float, headers: dict[str, str] | None = None
    ) -> Iterator[httpx.Response]:
        """A response whose body is streamed, with at most `read_s` seconds between its parts."""
        path = self._with_whole_id(path)
        timeout = httpx.Timeout(read_s, connect=min(read_s, _CONNECT_S))
        with (
            self._reached(),
            self._http.stream("GET", path, headers=headers, timeout=timeout) as answer,
        ):
            if not answer.is_success:
                answer.read()
                raise self._error(answer)
            yield answer

    def _with_whole_id(self, path: str) -> str:
        return _OF_A_JOB.sub(lambda found: found[1] + self.whole_id(found[2]), path)

    @contextmanager
    def _reached(self) -> Iterator[None]:
        try:
            yield
        except httpx.TimeoutException as error:
            raise Unreachable(self.url, str(error) or "it is silent") from error
        except httpx.TransportError as error:
            why = re.sub(r"^\[Errno -?\d+\] ", "", str(error))
            raise Unreachable(self.url, why) from error

    def _error(self, answer: httpx.Response) -> ClientError:
        try:
            problem = answer.json()
        except ValueError:
            problem = None
        if isinstance(problem, dict) and "type" in problem:
            retry_after_s = _seconds(answer.headers.get("Retry-After"))
            error = api_error(answer.status_code, problem, retry_after_s=retry_after_s)
            # A busy service is worth the longer wait.
            self._is_heard = self._is_heard or error.slug == "busy"
            return error
        if answer.status_code in _AWAY:  # a proxy in front of a service that is away
            return ApiError(answer.status_code, {})
        return NotPlateau(self.url, f"HTTP status {answer.status_code}")


class Calls:
    """A group of calls over one transport; `plateau.client.Client` is made of such groups.

    The errors of every call are documented there, the problems to expect with each method.
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
    """The trusted certificates: those of this machine, and of SSL_CERT_FILE.

    Plain HTTP needs none, since redirects are not followed; to read them would take 40 ms.
    """
    return ssl.create_default_context() if httpx.URL(url).scheme == "https" else False


def _seconds(header: str | None) -> float:
    return float(header) if header is not None and header.isascii() and header.isdigit() else 0.0


def _is_away(error: ClientError) -> bool:
    """Whether the same call may succeed in a moment."""
    return isinstance(error, Unreachable) or (isinstance(error, ApiError) and error.status in _AWAY)
