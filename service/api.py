"""The API as a process: checks where it may listen, and serves until it is told to stop."""

import logging
import socket
from collections.abc import Callable
from typing import Final

import uvicorn

from farm.blobs import Blobs
from farm.jobs import Jobs
from farm.redis_link import connect
from farm.settings import Settings
from service.app import create_app
from service.event_hub import EventHub
from service.guards import is_loopback

#: How long a request may take to end when the API stops; streams of events end at once.
_GRACE_S: Final = 5


class CannotListen(Exception):
    """The API may not, or cannot, listen on this address."""


def run(settings: Settings, *, host: str, port: int, ready: Callable[[str], None]) -> None:
    """Serve the API until SIGTERM or SIGINT.

    Parameters
    ----------
    settings
        With `redis_url` and `blobs` set.
    host, port
        Where to listen; port 0 takes a free one.
    ready
        Called with the API's URL once it answers.

    Raises
    ------
    CannotListen
        The host is not this machine's loopback, or the port is taken.
    """
    if settings.redis_url is None or settings.blobs is None:
        raise ValueError("the API needs redis_url and blobs")
    listener = listen(host, port)
    hub = EventHub(settings.redis_url)
    app = create_app(
        jobs=Jobs(connect(settings.redis_url)),
        blobs=Blobs(settings.blobs),
        hub=hub,
        max_upload_bytes=round(settings.max_upload_gb * 2**30),
    )
    config = uvicorn.Config(
        app,
        log_config=None,  # its lines go the way of ours
        log_level=logging.WARNING,
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=_GRACE_S,
    )
    _Server(config, hub, lambda: ready(url_of(listener))).run(sockets=[listener])


def listen(host: str, port: int) -> socket.socket:
    """A socket bound to a loopback address, or `CannotListen`."""
    if not is_loopback(host):
        raise CannotListen(
            f"refusing to listen on {host!r}: the API has no keys yet, so it listens on this "
            "machine only, as 127.0.0.1, ::1 or localhost; reach it from elsewhere by an SSH tunnel"
        )
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # By its name: asyncio looks for it before it sends small answers at once (TCP_NODELAY).
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host.strip("[]"), port))
    except OSError as error:
        listener.close()
        raise CannotListen(
            f"cannot listen on {host}, port {port}: {error.strerror}; "
            "stop what does, or give another --port"
        ) from error
    return listener


def url_of(listener: socket.socket) -> str:
    """The URL under which a listening socket is reached."""
    host, port = listener.getsockname()[:2]
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


class _Server(uvicorn.Server):
    """Says when it answers, and ends the streams of events before it waits for its clients."""

    def __init__(self, config: uvicorn.Config, hub: EventHub, ready: Callable[[], None]) -> None:
        super().__init__(config)
        self._hub = hub
        self._ready = ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self._ready()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._hub.stop_watching()
        await super().shutdown(sockets)
