"""Scenes are unpacked once, and only if they are what was asked for."""

import hashlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.model.errors import CorruptBlob, StoreUnavailable
from plateau.worker.supervisor.scene_cache import SceneCache
from tests.support.faults.loop_disk import LoopDisk
from tests.support.scenes.bundles import PLY, mesh, scene, zipped

SCENE = zipped({"scene.xml": scene(mesh("a.ply")), "a.ply": PLY}).getvalue()
SHA256 = hashlib.sha256(SCENE).hexdigest()
IN_USE_S = 600.0


def test_a_scene_is_fetched_once(store: Blobs, tmp_path: Path) -> None:
    store.put(blobs.scene(SHA256), SCENE)
    cache = SceneCache(store, tmp_path / "cache", IN_USE_S)
    files, entry = cache.scene(SHA256)
    assert (files / entry).read_bytes() == scene(mesh("a.ply"))
    assert (files / "a.ply").read_bytes() == PLY
    store.delete(blobs.scene(SHA256))
    assert cache.scene(SHA256) == (files, entry)


def test_one_that_is_not_there_is_a_missing_file(store: Blobs, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        SceneCache(store, tmp_path / "cache", IN_USE_S).scene(SHA256)
    assert list((tmp_path / "cache").iterdir()) == []


@pytest.mark.parametrize("damaged", [b"", SCENE[:-1], bytes(len(SCENE)), SCENE + b"x"])
def test_one_that_is_damaged_is_refused_till_it_is_whole(
    damaged: bytes, store: Blobs, tmp_path: Path
) -> None:
    store.put(blobs.scene(SHA256), damaged)
    cache = SceneCache(store, tmp_path / "cache", IN_USE_S)
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
        cache = SceneCache(store, disk.folder / "cache", IN_USE_S)
        store.put(blobs.scene(SHA256), SCENE)
        cache.scene(SHA256)
        for left, since in (([SHA256], time.time()), ([], 0)):  # what is in use stays
            os.utime(cache.folder / SHA256, (since, since))
            with pytest.raises(StoreUnavailable, match=r"cannot be unpacked.*No space left"):
                cache.scene(sha256)
            assert [one.name for one in cache.folder.iterdir()] == left


def test_what_a_killed_worker_was_making_goes_in_the_end(store: Blobs, tmp_path: Path) -> None:
    store.put(blobs.scene(SHA256), SCENE)
    cache = SceneCache(store, tmp_path, IN_USE_S)
    for name in (".making-now", ".making-once"):
        (tmp_path / name).mkdir()
    os.utime(tmp_path / ".making-once", (0, 0))
    cache.scene(SHA256)
    assert {path.name for path in tmp_path.iterdir()} == {"blobs", SHA256, ".making-now"}


def put_scenes(store: Blobs, count: int) -> list[str]:
    """Put so many scenes; returns their names."""
    names = []
    for number in range(count):
        content = zipped({"scene.xml": scene(mesh("a.ply")), "a.ply": PLY, f"{number}": b""})
        names.append(hashlib.sha256(content.getvalue()).hexdigest())
        store.put(blobs.scene(names[-1]), content.getvalue())
    return names


def ask_in_turn(cache: SceneCache, folder: Path, names: list[str]) -> None:
    """Ask for one after the other, long ago."""
    for age, name in enumerate(names):
        cache.scene(name)
        os.utime(folder / name, (1e9 + age, 1e9 + age))


def test_of_many_scenes_the_last_used_stay(store: Blobs, tmp_path: Path) -> None:
    cache, names = SceneCache(store, tmp_path / "cache", IN_USE_S), put_scenes(store, 18)
    ask_in_turn(cache, tmp_path / "cache", names)
    assert {path.name for path in tmp_path.joinpath("cache").iterdir()} == set(names[2:])


def test_one_that_was_asked_for_stays_while_it_may_be_loading(store: Blobs, tmp_path: Path) -> None:
    # Given more workers than scenes that stay, each with a scene of its own
    cache, names = SceneCache(store, tmp_path / "cache", IN_USE_S), put_scenes(store, 18)
    given = [cache.scene(name)[0] for name in names]
    # Then every one has its files
    assert all((files / "a.ply").exists() for files in given)
    # And once that of the first has been loaded for sure, it goes
    long_ago = time.time() - IN_USE_S - 1
    os.utime(tmp_path / "cache" / names[0], (long_ago, long_ago))
    cache.scene(names[1])
    assert not given[0].exists()
    assert all(files.exists() for files in given[1:])


#: Asks for a scene, and so forgets another; in the midst of that something happens.
ASKER = """
import os, signal, sys
from pathlib import Path
from plateau.farm.blobs.store import Blobs
from plateau.worker.supervisor.scene_cache import SceneCache

store, folder, wanted, oldest, moment, action = sys.argv[1:]
seen = set()

def hook(event, about):
    if event == "os.rename" and oldest in str(about[0]):
        seen.add("about to be renamed")
    if event == "shutil.rmtree" and ".making" not in str(about[0]):
        seen.add("going")
    if event == "os.rmdir" and "going" in seen:
        seen.add("half removed")
    if moment in seen:
        seen.clear()
        exec(action)

sys.addaudithook(hook)
SceneCache(Blobs(store), Path(folder), 600.0).scene(wanted)
"""


def ask(tmp_path: Path, wanted: str, oldest: str, moment: str, action: str) -> int:
    """Have another worker ask; returns how it ended."""
    places = [str(tmp_path / "blobs"), str(tmp_path / "cache")]
    return subprocess.run(
        [sys.executable, "-c", ASKER, *places, wanted, oldest, moment, action],
        check=False,
        timeout=120,
    ).returncode


def test_one_that_was_half_removed_is_unpacked_anew(store: Blobs, tmp_path: Path) -> None:
    cache, names = SceneCache(store, tmp_path / "cache", IN_USE_S), put_scenes(store, 17)
    ask_in_turn(cache, tmp_path / "cache", names[:16])
    # Given a worker that is killed when it has removed a scene's files, and not yet their folder
    kill = "os.kill(os.getpid(), signal.SIGKILL)"
    assert ask(tmp_path, names[16], names[0], "half removed", kill) == -signal.SIGKILL
    # Then who asks for that scene has all its files
    files, entry = cache.scene(names[0])
    assert {path.name for path in files.iterdir()} == {entry, "a.ply", "0"}
    # And what was left of it goes in the end
    for left in (tmp_path / "cache").glob(".*"):
        os.utime(left, (0, 0))
    cache.scene(names[0])
    assert list((tmp_path / "cache").glob(".*")) == []


def test_one_that_is_asked_for_as_it_is_to_be_forgotten_stays(store: Blobs, tmp_path: Path) -> None:
    cache, names = SceneCache(store, tmp_path / "cache", IN_USE_S), put_scenes(store, 17)
    ask_in_turn(cache, tmp_path / "cache", names[:16])
    # When a worker is about to forget the oldest, and another asks for it
    use = "os.utime(Path(folder) / oldest)"
    assert ask(tmp_path, names[16], names[0], "about to be renamed", use) == 0
    # Then it is still there, as it was
    store.delete(blobs.scene(names[0]))
    assert (cache.scene(names[0])[0] / "a.ply").read_bytes() == PLY
    assert list((tmp_path / "cache").glob(".*")) == []
