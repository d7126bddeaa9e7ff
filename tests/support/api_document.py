"""What the API says of itself, without a server: its OpenAPI document."""

import tempfile
from functools import cache
from typing import Any

from plateau.farm.blobs.store import Blobs
from plateau.farm.bundle import BundleLimits
from plateau.farm.redis.link import connect
from plateau.service.api.app import create_app
from plateau.service.api.event_hub import EventHub
from plateau.service.api.scene_checks.pool import SceneChecks
from tests.support.farms.live_api import LARGEST_UPLOAD


@cache
def api_document() -> dict[str, Any]:
    """The OpenAPI document; no Redis is asked for it."""
    nowhere = "redis://127.0.0.1:1"
    with tempfile.TemporaryDirectory() as folder:
        app = create_app(
            client=connect(nowhere),
            blobs=Blobs(folder),
            hub=EventHub(nowhere),
            checks=SceneChecks(BundleLimits(max_bytes=LARGEST_UPLOAD)),
        )
    return app.openapi()
