"""The API as a process: checks that it may listen, and serves until it is told to stop."""

import logging
import os
import socket
import ssl
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Final

import uvicorn

from plateau.farm.blobs.store import Blobs
from plateau.farm.bundle import BundleLimits, known_plugins
from plateau.farm.ledger.api_keys import ApiKeys
from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.process.settings import Settings
from plateau.farm.redis.link import connect
from plateau.farm.redis.url import is_loopback
from plateau.service.api.access.key_guard import Access
from plateau.service.api.app import create_app
from plateau.service.api.event_hub import EventHub
from plateau.service.api.http.server import (
    backlog,
    most_connections,
    raise_descriptor_limit,
    server_config,
)
from plateau.service.api.scene_checks.placing import Placing
from plateau.service.api.scene_checks.pool import SceneChecks
from plateau.service.notices.targets import read_targets

#: How long requests may take to end when the API stops, in seconds; streams end at once.
_GRACE_S: Final = 5
#: The longest that a client may leave an answer unread, in seconds.
UNREAD_S: Final = 300.0

#: How to keep others from reading keys on the network.
_TLS: Final = (
    "give the API a certificate (--tls-certificate, --tls-key), or put a proxy with TLS in front"
)

_LOG = logging.getLogger(__name__)


class CannotListen(Exception):
    """The API may not, or cannot, listen on this address."""


def run(
    settings: Settings,
    *,
    host: str,
    port: int,
    open_to_all: bool,
    certificate: Path | None,
    private_key: Path | None,
    ready: Callable[[str], None],
) -> None:
    """Serve the API until SIGTERM or SIGINT.

    Parameters
    ----------
    settings
        With `redis_url` and `blobs` set.
    host, port
        The address to listen on; port 0 takes a free one.
    open_to_all
        Demand no keys even if some exist; for loopback addresses only.
    certificate, private_key
        The PEM files of a certificate chain and of its key, for https; None for plain HTTP.
    ready
        Called with the API's URL once it answers.

    Raises
    ------
    CannotListen
        The host is not loopback and no key exists, the port is taken, or the certificate unusable.
    """
    if settings.redis_url is None or settings.blobs is None:
        raise ValueError("the API needs redis_url and blobs")
    spool_in(settings.cache / "uploads")
    limits = BundleLimits(settings.max_upload_bytes, plugins=known_plugins(settings.plugins))
    checks = SceneChecks(limits)
    targets = read_targets(settings)
    client = connect(settings.redis_url)
    access = access_at(host, ApiKeys(client), open_to_all=open_to_all)
    if certificate is not None:
        _check_certificate(certificate, private_key)
    elif access is Access.KEYS:
        _LOG.warning("keys come over plain HTTP, which others on the network can read: %s", _TLS)
    listener = listen(host, port)
    checks.warm_up()  # in parallel with making the app, which takes as long
    hub = EventHub(settings.redis_url)
    app = create_app(
        client=client,
        blobs=Blobs(settings.blobs),
        hub=hub,
        checks=checks,
        access=access,
        webhook_allow=settings.webhook_allow,
        targets=targets,
        placing=Placing(settings.scene_roots, settings.hashes),
    )
    descriptors = raise_descriptor_limit()
    config = server_config(
        app,
        grace_s=_GRACE_S,
        limit_concurrency=most_connections(descriptors),
        backlog=backlog(descriptors),
        log_level=logging.WARNING,
        ssl_certfile=certificate,
        ssl_keyfile=None if private_key is None else str(private_key),
    )
    url = url_of(listener, "http" if certificate is None else "https")
    Server(config, hub, lambda: ready(url)).run(sockets=[listener])


def _check_certificate(certificate: Path, private_key: Path | None) -> None:
    """Raise `CannotListen` unless the two can be used together."""
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate, private_key)
    except OSError as error:
        raise CannotListen(
            f"the certificate {certificate} with the key {private_key} cannot be "
            f"used: {error.strerror or error}"
        ) from error


def spool_in(folder: Path) -> None:
    """Keep this process's temporary files in this folder, unless ``TMPDIR`` names another.

    On many systems ``/tmp`` is memory, which a few bundles of 2 GB would fill. The files have no
    names, so nothing is left of them if the process is killed.
    """
    if "TMPDIR" in os.environ:
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        _LOG.warning(
            "uploads go to %s, because %s cannot be used: %s", tempfile.gettempdir(), folder, error
        )
    else:
        tempfile.tempdir = str(folder)


def access_at(host: str, keys: ApiKeys, *, open_to_all: bool) -> Access:
    """When an API that listens on this host demands keys.

    Raises `CannotListen` if other machines could reach it, and it is open or has no usable key.
    """
    if is_loopback(host):
        return Access.OPEN if open_to_all else Access.UNTIL_KEYS
    if open_to_all:
        raise CannotListen(
            f"refusing to listen on {host!r} with --open: other machines reach that address; an "
            "open API listens on this machine only, as 127.0.0.1, ::1 or localhost"
        )
    try:
        usable = any(key.usable for key in keys.all())
    except StoreUnavailable as error:
        _LOG.warning("%s; it is not known whether keys exist, and each request needs one", error)
        return Access.KEYS
    if not usable:
        raise CannotListen(
            f"refusing to listen on {host!r} without a key: other machines reach that address; "
            "make one with `plateau keys create NAME --role admin` and start again, or listen on "
            "127.0.0.1"
        )
    return Access.KEYS


def listen(host: str, port: int) -> socket.socket:
    """A socket bound to the address, or `CannotListen`."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # With IPPROTO_TCP: asyncio sets TCP_NODELAY, which sends small answers at once, only with it.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if hasattr(socket, "TCP_USER_TIMEOUT"):  # Linux; its connections inherit it
            timeout_ms = int(UNREAD_S * 1000)
            listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, timeout_ms)
        listener.bind((host.strip("[]"), port))
    except OSError as error:
        listener.close()
        raise CannotListen(
            f"cannot listen on {host}, port {port}: {error.strerror}; "
            "stop what does, or give another --port"
        ) from error
    return listener


def url_of(listener: socket.socket, scheme: str = "http") -> str:
    """The URL under which a listening socket is reached."""
    host, port = listener.getsockname()[:2]
    return f"{scheme}://[{host}]:{port}" if ":" in host else f"{scheme}://{host}:{port}"


class Server(uvicorn.Server):
    """Says when it answers, and ends the streams of events before it waits for its clients."""

    def __init__(self, config: uvicorn.Config, hub: EventHub, ready: Callable[[], None]) -> None:
        super().__init__(config)
        self._hub = hub
        self._ready = ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start as uvicorn does, and say so."""
        # The first request may come before the first tick, which adds the date.
        self.server_state.default_headers = self.config.encoded_headers
        await super().startup(sockets)
        self._ready()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End the streams, and then stop as uvicorn does."""
        self._hub.stop_watching()
        await super().shutdown(sockets)
