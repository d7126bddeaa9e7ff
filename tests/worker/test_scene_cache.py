"""Scenes are unpacked once, and only if they are what was asked for."""

import hashlib
import os
from pathlib import Path

import pytest

from farm import blobs
from farm.blobs import Blobs
from farm.errors import CorruptBlob, StoreUnavailable
from tests.support.bundles import PLY, mesh, scene, zipped
from tests.support.loop_disk import LoopDisk
from worker.scene_cache import SceneCache

SCENE = zipped({"scene.xml": scene(mesh("a.ply")), "a.ply": PLY}).getvalue()
SHA256 = hashlib.sha256(SCENE).hexdigest()


def test_a_scene_is_fetched_once(store: Blobs, tmp_path: Path) -> None:
    store.put(blobs.scene(SHA256), SCENE)
    cache = SceneCache(store, tmp_path / "cache")
    files, entry = cache.scene(SHA256)
    assert (files / entry).read_bytes() == scene(mesh("a.ply"))
    assert (files / "a.ply").read_bytes() == PLY
    store.delete(blobs.scene(SHA256))
    assert cache.scene(SHA256) == (files, entry)


def test_one_that_is_not_there_is_a_missing_file(store: Blobs, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        SceneCache(store, tmp_path / "cache").scene(SHA256)
    assert list((tmp_path / "cache").iterdir()) == []


@pytest.mark.parametrize("damaged", [b"", SCENE[:-1], bytes(len(SCENE)), SCENE + b"x"])
def test_one_that_is_damaged_is_refused_till_it_is_whole(
    damaged: bytes, store: Blobs, tmp_path: Path
) -> None:
    store.put(blobs.scene(SHA256), damaged)
    cache = SceneCache(store, tmp_path / "cache")
    with pytest.raises(CorruptBlob, match=rf"scene {SHA256} is damaged.*submit the scene"):
        cache.scene(SHA256)
    assert list((tmp_path / "cache").iterdir()) == []
    store.put(blobs.scene(SHA256), SCENE)
    assert (cache.scene(SHA256)[0] / "a.ply").read_bytes() == PLY


def test_a_full_disk_is_no_fault_of_the_scene(store: Blobs, tmp_path: Path) -> None:
    big = scene(f"<!-- {os.urandom(3_000_000).hex()} -->")
    sha256 = hashlib.sha256(big).hexdigest()
    store.put(blobs.scene(sha256), big)
    with LoopDisk(tmp_path / "disk", megabytes=4) as disk:
        cache = SceneCache(store, disk.folder / "cache")
        with pytest.raises(StoreUnavailable, match=r"cannot be unpacked.*No space left"):
            cache.scene(sha256)
        assert list((disk.folder / "cache").iterdir()) == []


def test_what_a_killed_worker_was_making_goes_in_the_end(store: Blobs, tmp_path: Path) -> None:
    store.put(blobs.scene(SHA256), SCENE)
    cache = SceneCache(store, tmp_path)
    for name in (".making-now", ".making-once"):
        (tmp_path / name).mkdir()
    os.utime(tmp_path / ".making-once", (0, 0))
    cache.scene(SHA256)
    assert {path.name for path in tmp_path.iterdir()} == {"blobs", SHA256, ".making-now"}


def test_of_many_scenes_the_last_used_stay(store: Blobs, tmp_path: Path) -> None:
    cache = SceneCache(store, tmp_path / "cache")
    scenes = [scene(f"<!-- {number} -->") for number in range(18)]
    names = [hashlib.sha256(content).hexdigest() for content in scenes]
    for age, (name, content) in enumerate(zip(names, scenes, strict=True)):
        store.put(blobs.scene(name), content)
        cache.scene(name)
        os.utime(tmp_path / "cache" / name, (1e9 + age, 1e9 + age))
    assert {path.name for path in (tmp_path / "cache").iterdir()} == set(names[2:])
