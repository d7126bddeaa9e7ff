"""The request that POSTs a notice: guarded, bounded and signed.

It uses httpcore and not httpx, because httpx does not let the caller choose the address. httpcore
follows no redirects and uses no proxies. Signing takes five lines, so it needs no library; the
tests verify signatures with that of Standard Webhooks.
"""

import base64
import hmac
import ssl
import time
from collections.abc import Callable, Iterable
from datetime import datetime
from functools import cached_property
from typing import Any, Final
from urllib.parse import urlsplit

import httpcore

from plateau.farm.model import versions
from plateau.farm.model.spec.notice import SECRET_PREFIX
from plateau.service.notices.receivers import ReceiverRefused, Receivers

CONNECT_S: Final = 5.0
TOTAL_S: Final = 15.0
#: The most bytes that are read of an answer's body.
_MOST_BYTES: Final = 16_384
#: The most digits of a believable `Retry-After`.
_DIGITS: Final = 6


class NoResponse(Exception):
    """The receiver did not answer; the message says why."""


class Response:
    """The receiver's answer: its status and its ``Retry-After``."""

    def __init__(self, status: int, headers: Iterable[tuple[bytes, bytes]]) -> None:
        self.status = status
        self.retry_after_s = 0.0
        for name, value in headers:
            if name.lower() == b"retry-after" and value.isdigit() and len(value) <= _DIGITS:
                self.retry_after_s = float(value)


def tls_context() -> ssl.SSLContext:
    """The context that trusts certifi's authorities, or those of ``SSL_CERT_FILE``."""
    import httpx  # here, because a monitor starts sooner without it

    return httpx.create_ssl_context()


def signed_headers(message_id: str, at: datetime, body: bytes, secret: str) -> dict[str, str]:
    """The headers of Standard Webhooks.

    `message_id` is the same for every try, `at` the time of this one. `secret` is a key in base64
    after ``whsec_``.
    """
    timestamp = int(at.timestamp())
    signed = f"{message_id}.{timestamp}.".encode() + body
    key = base64.b64decode(secret.removeprefix(SECRET_PREFIX))
    signature = base64.b64encode(hmac.digest(key, signed, "sha256")).decode()
    return {
        "content-type": "application/json",
        "user-agent": f"Plateau/{versions.plateau()}",
        "webhook-id": message_id,
        "webhook-timestamp": str(timestamp),
        "webhook-signature": f"v1,{signature}",
    }


class Requests:
    """Sends requests to allowed receivers, with time-outs for connecting and for everything.

    `tls` makes the TLS context at its first use: it takes 0.1 s, and most farms POST no notice.
    """

    def __init__(
        self,
        receivers: Receivers,
        tls: Callable[[], ssl.SSLContext] = tls_context,
        *,
        connect_s: float = CONNECT_S,
        total_s: float = TOTAL_S,
    ) -> None:
        self._receivers = receivers
        self._make_tls = tls
        self._connect_s = connect_s
        self._total_s = total_s

    @cached_property
    def _tls(self) -> ssl.SSLContext:
        return self._make_tls()

    def post(self, url: str, headers: dict[str, str], body: bytes) -> Response:
        """Send the request; raises `NoResponse` if the receiver is not allowed, or silent."""
        parts = urlsplit(url)
        plain = parts.scheme == "http"
        target = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
        asked = httpcore.URL(
            scheme=parts.scheme, host=parts.hostname or "", port=parts.port, target=target
        )
        backend = _Guarded(self._receivers, plain, time.monotonic() + self._total_s)
        timeouts = dict.fromkeys(("read", "write", "pool"), self._total_s)
        timeouts["connect"] = self._connect_s
        sent = [("host", parts.netloc), *headers.items()]
        try:
            with (
                httpcore.ConnectionPool(
                    ssl_context=None if plain else self._tls, network_backend=backend
                ) as pool,
                pool.stream(
                    "POST", asked, headers=sent, content=body, extensions={"timeout": timeouts}
                ) as response,
            ):
                _read_some(response)
                return Response(response.status, response.headers)
        except ReceiverRefused as refused:
            raise NoResponse(str(refused)) from refused
        except httpcore.ConnectTimeout as error:
            raise NoResponse(f"no connection within {self._connect_s:g} s") from error
        except httpcore.TimeoutException as error:
            raise NoResponse(f"no answer within {self._total_s:g} s") from error
        except (httpcore.NetworkError, httpcore.ProtocolError, ssl.SSLError) as error:
            raise NoResponse(str(error) or type(error).__name__) from error


def _read_some(response: httpcore.Response) -> None:
    """Read the body up to a limit; only the status matters, so errors are ignored."""
    read = 0
    try:
        for chunk in response.iter_stream():
            read += len(chunk)
            if read > _MOST_BYTES:
                return
    except (httpcore.TimeoutException, httpcore.NetworkError, httpcore.ProtocolError):
        return


class _Guarded(httpcore.NetworkBackend):
    """Connects to checked addresses only, until `ends` at most."""

    def __init__(self, receivers: Receivers, plain: bool, ends: float) -> None:
        self._receivers = receivers
        self._plain = plain
        self._ends = ends
        self._sockets = httpcore.SyncBackend()

    def connect_tcp(
        self,
        host: str,
        port: int,
        timeout: float | None = None,
        local_address: str | None = None,
        socket_options: Iterable[Any] | None = None,
    ) -> httpcore.NetworkStream:
        # The name is resolved once, and the connection goes to a checked address, not to the name.
        addresses = self._receivers.addresses(host, port, plain=self._plain)
        ends = self._ends if timeout is None else min(self._ends, time.monotonic() + timeout)
        failed: Exception = httpcore.ConnectError(f"{host} has no address")
        for address in addresses:
            left_s = _left(ends, httpcore.ConnectTimeout)
            try:
                stream = self._sockets.connect_tcp(
                    address, port, left_s, local_address, socket_options
                )
            except (httpcore.ConnectError, httpcore.ConnectTimeout) as error:
                failed = error
            else:
                return _Bounded(stream, self._ends)
        raise failed


class _Bounded(httpcore.NetworkStream):
    """A stream whose operations all end by `ends`, also if data come byte by byte."""

    def __init__(self, stream: httpcore.NetworkStream, ends: float) -> None:
        self._stream = stream
        self._ends = ends

    def read(self, max_bytes: int, timeout: float | None = None) -> bytes:
        return self._stream.read(max_bytes, _left(self._ends, httpcore.ReadTimeout, timeout))

    def write(self, buffer: bytes, timeout: float | None = None) -> None:
        self._stream.write(buffer, _left(self._ends, httpcore.WriteTimeout, timeout))

    def close(self) -> None:
        self._stream.close()

    def start_tls(
        self,
        ssl_context: ssl.SSLContext,
        server_hostname: str | None = None,
        timeout: float | None = None,
    ) -> httpcore.NetworkStream:
        left_s = _left(self._ends, httpcore.ConnectTimeout, timeout)
        return _Bounded(self._stream.start_tls(ssl_context, server_hostname, left_s), self._ends)

    def get_extra_info(self, info: str) -> Any:
        return self._stream.get_extra_info(info)


def _left(ends: float, late: type[Exception], most_s: float | None = None) -> float:
    """The seconds left until `ends`, at most `most_s`; raises `late` if none are left."""
    left_s = ends - time.monotonic()
    if left_s <= 0:
        raise late
    return left_s if most_s is None else min(left_s, most_s)
