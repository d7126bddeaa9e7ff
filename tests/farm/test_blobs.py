"""The blob store keeps whole blobs and lists them."""

import io
from pathlib import Path

import pytest

from farm import blobs
from farm.blobs import Blobs
from farm.errors import StoreUnavailable


def test_what_is_put_is_got(store: Blobs) -> None:
    store.put(blobs.scene("ab"), b"scene")
    store.put("big", io.BytesIO(bytes(9_000_000)))
    assert store.get("scenes/ab") == b"scene"
    assert b"".join(store.chunks("big")) == bytes(9_000_000)
    store.put("big", b"small now")
    assert store.get("big") == b"small now"


def test_a_missing_blob_is_a_missing_file(store: Blobs) -> None:
    assert not store.exists("nothing")
    with pytest.raises(FileNotFoundError):
        store.get("nothing")
    store.delete("nothing")


def test_names_are_listed_by_prefix(store: Blobs) -> None:
    names = [blobs.partial("j", index, "w-1") for index in range(3)]
    for name in [*names, blobs.result("j", "image.exr"), blobs.partial("k", 0, "w-1")]:
        store.put(name, b"x")
    assert sorted(store.names(blobs.partials("j"))) == names
    store.delete(*names)
    assert store.names(blobs.partials("j")) == []
    assert store.exists("jobs/j/image.exr")


def test_a_store_that_refuses_is_one_clear_error(tmp_path: Path) -> None:
    store = Blobs(str(tmp_path / "blobs"))
    store.put("a", b"x")
    with pytest.raises(StoreUnavailable, match="blob store failed"):
        store.put("a/below-a-file", b"x")
