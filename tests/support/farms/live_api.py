"""A real API on an ephemeral port, in a thread of the test's process."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import httpx

from plateau.farm.blobs.store import Blobs
from plateau.farm.bundle import BundleLimits, known_plugins
from plateau.farm.redis.link import connect
from plateau.service.api.access.key_guard import Access
from plateau.service.api.app import create_app
from plateau.service.api.event_hub import EventHub
from plateau.service.api.http.server import server_config
from plateau.service.api.process import Server, listen, url_of
from plateau.service.api.scene_checks.placing import Placing
from plateau.service.api.scene_checks.pool import SceneChecks
from plateau.service.notices.targets import Targets

LARGEST_UPLOAD = 3_000_000


@contextmanager
def live_api(
    redis_url: str,
    store: Blobs,
    *,
    port: int = 0,
    access: Access = Access.UNTIL_KEYS,
    webhook_allow: tuple[str, ...] = (),
    targets: Targets | None = None,
    placing: Placing | None = None,
    grace_s: int = 8,
) -> Iterator[str]:
    """The URL of an API over this Redis and this store; it is stopped on leaving.

    Requests that are under way by then have `grace_s` seconds left.
    """
    listener = listen("127.0.0.1", port)
    hub = EventHub(redis_url)
    app = create_app(
        client=connect(redis_url, 120.0),
        blobs=store,
        hub=hub,
        checks=SceneChecks(BundleLimits(max_bytes=LARGEST_UPLOAD, plugins=known_plugins())),
        access=access,
        webhook_allow=webhook_allow,
        targets=targets,
        placing=placing,
    )
    server = Server(server_config(app, grace_s=grace_s, log_level="critical"), hub, lambda: None)
    # The socket listens before the loop runs: whoever connects now waits a moment.
    listener.listen()
    thread = threading.Thread(target=server.run, args=([listener],), daemon=True)
    thread.start()
    try:
        yield url_of(listener)
    finally:
        server.should_exit = True
        thread.join(60)
        listener.close()
        assert not thread.is_alive(), "the API did not stop"


@contextmanager
def live_http(redis_url: str, store: Blobs, **options: Any) -> Iterator[httpx.Client]:
    """A client of an API of its own; `options` are those of `live_api`."""
    with live_api(redis_url, store, **options) as url, http_client(url) as http:
        yield http


def http_client(url: str, **headers: str) -> httpx.Client:
    # To load the certificates that nobody shows here takes longer than most tests.
    return httpx.Client(base_url=url, headers=headers, trust_env=False, verify=False, timeout=60)
