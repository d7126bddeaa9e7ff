"""A scene whose blob was torn heals when it is submitted again."""

import hashlib
from pathlib import Path

import pytest

from plateau.client import ApiError, Client
from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from tests.support.farms.live_api import live_api
from tests.support.scenes.bundles import scene


@pytest.mark.parametrize("left", [0, 10])
def test_a_torn_scene_is_put_again(left: int, redis_url: str, store: Blobs, tmp_path: Path) -> None:
    box = tmp_path / "box.xml"
    box.write_bytes(scene())
    with live_api(redis_url, store) as url, Client(url) as client:
        sha256 = client.submit(box).scene_sha256
        # Given a blob that lost its end
        blob = tmp_path / "blobs" / blobs.scene(sha256)
        blob.write_bytes(blob.read_bytes()[:left])
        # Then a job cannot be made from it by its name
        with pytest.raises(ApiError, match=r"damaged.*send the file itself"):
            client.submit(sha256)
        # But from the file it can, and by its name again from then on
        assert client.submit(box).scene_sha256 == sha256
        assert hashlib.sha256(blob.read_bytes()).hexdigest() == sha256
        assert client.submit(sha256).scene_sha256 == sha256
