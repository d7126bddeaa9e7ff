"""How many requests this API process answered, how, and how fast; by route, never by raw path."""

import time
from collections.abc import Iterable, Iterator
from typing import Final

from prometheus_client.core import GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.registry import Collector
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from plateau.farm.model.durations import Durations
from plateau.service.api.metrics.prometheus import add_histogram

_BOUNDS_S: Final = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 60.0)

#: Any other method is a client's fancy, and would be a series of its own.
_METHODS: Final = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})

#: The route of a request that no route took: refused before, or nothing is there.
_NO_ROUTE: Final = "none"

_STREAM: Final = b"text/event-stream"


class Requests(Collector):
    """What this process has answered since it started."""

    def __init__(self) -> None:
        self._durations: dict[tuple[str, str, str], Durations] = {}
        self._streams = 0

    def answered(self, route: str, method: str, status: int, seconds: float) -> None:
        """Count an answer."""
        key = (route, method if method in _METHODS else "other", f"{status // 100}xx")
        self._durations.setdefault(key, Durations(_BOUNDS_S)).note(seconds)

    def stream_opened(self) -> None:
        """Count a stream of events; it lasts as long as somebody watches, so it has no latency."""
        self._streams += 1

    def stream_closed(self) -> None:
        """Count it no more."""
        self._streams -= 1

    def collect(self) -> Iterator[Metric]:
        """The metrics of this process's requests."""
        durations = HistogramMetricFamily(
            "plateau_http_request_duration_seconds",
            "Seconds from an HTTP request's arrival until its answer was sent, "
            "in this API process; streams of events are left out.",
            labels=("route", "method", "status"),
        )
        for labels, noted in tuple(self._durations.items()):
            add_histogram(durations, labels, noted.histogram())
        yield durations
        streams = GaugeMetricFamily(
            "plateau_http_event_streams",
            "Streams of events that clients of this API process have open now.",
        )
        streams.add_metric((), self._streams)
        yield streams


class CountRequests:
    """Tells `Requests` of every answer; the outermost of the app's layers, so that it sees all."""

    def __init__(self, app: ASGIApp, requests: Requests) -> None:
        self._app = app
        self._requests = requests

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, and look at its answer."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        started = time.monotonic()
        status, streams = 500, False  # unless an answer begins

        async def seen(message: Message) -> None:
            nonlocal status, streams
            if message["type"] == "http.response.start":
                status = message["status"]
                if _is_stream(message["headers"]):
                    streams = True
                    self._requests.stream_opened()
            await send(message)

        try:
            await self._app(scope, receive, seen)
        finally:
            if streams:
                self._requests.stream_closed()
            else:
                seconds = time.monotonic() - started
                self._requests.answered(_route(scope), scope["method"], status, seconds)


def _is_stream(headers: Iterable[tuple[bytes, bytes]]) -> bool:
    return any(name == b"content-type" and value.startswith(_STREAM) for name, value in headers)


def _route(scope: Scope) -> str:
    """The template of the path, as ``/v1/jobs/{job_id}``."""
    return getattr(scope.get("route"), "path", _NO_ROUTE)
