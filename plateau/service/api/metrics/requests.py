"""Numbers and durations of this API process's requests, by route and never by raw path."""

import time
from collections.abc import Iterable
from typing import Final

from prometheus_client import CollectorRegistry, Gauge, Histogram, disable_created_metrics
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from plateau.service.api.http.layers import Layer

_BOUNDS_S: Final = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 60.0)

#: Methods that have a series of their own; all others share one.
_METHODS: Final = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})

#: The label of a request that reached no route: refused before, or to an unknown path.
_NO_ROUTE: Final = "none"

_STREAM: Final = b"text/event-stream"


class Requests:
    """The durations of requests since the process started, and the open streams of events.

    A stream lasts as long as somebody watches, so it has no duration here.
    """

    def __init__(self, registry: CollectorRegistry) -> None:
        # Otherwise each series has a second one with the time of its creation.
        disable_created_metrics()  # type: ignore[no-untyped-call]
        self.durations = Histogram(
            "plateau_http_request_duration_seconds",
            "Seconds from an HTTP request's arrival until its answer was sent, "
            "in this API process; streams of events are left out.",
            ("route", "method", "status"),
            buckets=_BOUNDS_S,
            registry=registry,
        )
        self.streams = Gauge(
            "plateau_http_event_streams",
            "Streams of events that clients of this API process have open now.",
            registry=registry,
        )


class CountRequests(Layer):
    """Counts every answer; it is the app's outermost layer, so it sees all of them."""

    def __init__(self, app: ASGIApp, requests: Requests) -> None:
        super().__init__(app)
        self._requests = requests

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, and measure its answer."""
        started = time.monotonic()
        status, streams = 500, False  # unless an answer begins

        async def seen(message: Message) -> None:
            nonlocal status, streams
            if message["type"] == "http.response.start":
                status = message["status"]
                if _is_stream(message["headers"]):
                    streams = True
                    self._requests.streams.inc()
            await send(message)

        try:
            await self.app(scope, receive, seen)
        finally:
            if streams:
                self._requests.streams.dec()
            else:
                route = getattr(scope.get("route"), "path", _NO_ROUTE)  # as /v1/jobs/{job_id}
                method = scope["method"] if scope["method"] in _METHODS else "other"
                alike = self._requests.durations.labels(route, method, f"{status // 100}xx")
                alike.observe(time.monotonic() - started)


def _is_stream(headers: Iterable[tuple[bytes, bytes]]) -> bool:
    return any(name == b"content-type" and value.startswith(_STREAM) for name, value in headers)
