"""The blob store keeps whole blobs and lists them."""

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from plateau.farm.blobs.store import Blobs
from plateau.farm.model.errors import StoreUnavailable
from tests.support.blob_contract import BlobContract
from tests.support.faults.loop_disk import LoopDisk
from tests.support.until import until


class TestAFolder(BlobContract):
    """Does what every store must do; S3 servers are held against the same in tests/cluster."""


def test_a_folder_may_be_given_as_a_url(tmp_path: Path) -> None:
    Blobs(f"file://{tmp_path}/a%20b").put("x/y", b"z")
    assert (tmp_path / "a b" / "x" / "y").read_bytes() == b"z"


class TestAPutThatFails:
    """Leaves nothing behind, neither under the blob's name nor under another."""

    def test_on_a_full_disk(self, tmp_path: Path) -> None:
        with LoopDisk(tmp_path / "disk", megabytes=4) as disk:
            store = Blobs(str(disk.folder / "blobs"))
            for content in (bytes(8_000_000), io.BytesIO(bytes(20_000_000))):
                with pytest.raises(StoreUnavailable, match="No space left"):
                    store.put("jobs/j/image.exr", content)
                assert files_below(disk.folder / "blobs") == []
            # And there is room again, as soon as the disk has noted what went
            until(lambda: is_put(store, "jobs/j/image.exr", b"small"), 60, every_s=0.2)
            assert store.get("jobs/j/image.exr") == b"small"

    def test_on_a_folder_that_is_read_only(self, tmp_path: Path) -> None:
        with LoopDisk(tmp_path / "disk", megabytes=4) as disk:
            store = Blobs(str(disk.folder / "blobs"))
            store.put("a", b"x")
            disk.make_read_only()
            with pytest.raises(StoreUnavailable, match="Read-only"):
                store.put("b", b"x")
            assert store.get("a") == b"x"

    def test_in_its_last_step(self, store: Blobs, tmp_path: Path) -> None:
        store.put("a", b"x")
        with pytest.raises(StoreUnavailable):
            store.put("a/below-a-file", b"x")
        assert files_below(tmp_path / "blobs") == [tmp_path / "blobs" / "a"]


def test_a_put_that_is_killed_leaves_what_nobody_takes_for_a_blob(
    store: Blobs, tmp_path: Path
) -> None:
    # Given a process that is killed while it puts a blob
    program = (
        "import io, sys, time; from plateau.farm.blobs.store import Blobs\n"
        "class Slow(io.BytesIO):\n"
        "    def read(self, size=-1):\n"
        "        time.sleep(60 if self.tell() else 0)\n"
        "        return super().read(size)\n"
        "Blobs(sys.argv[1]).put('jobs/j/image.exr', Slow(bytes(20_000_000)))"
    )
    putting = subprocess.Popen([sys.executable, "-c", program, store.where])
    try:
        until(lambda: any(path.stat().st_size for path in store.leftovers(-1)))
    finally:
        putting.kill()
        putting.wait()
    # Then there is no such blob, though half of its bytes are on the disk
    left = store.leftovers(-1)
    assert len(left) == 1
    assert left == files_below(tmp_path / "blobs")
    assert store.names("") == []
    assert not store.exists("jobs/j/image.exr")
    with pytest.raises(FileNotFoundError):
        store.get("jobs/j/image.exr")
    # And it can be put, and the rest removed once it is old
    store.put("jobs/j/image.exr", b"whole")
    assert store.names("") == ["jobs/j/image.exr"]
    assert store.leftovers(older_than_s=3600) == []
    os.utime(left[0], (0, 0))
    assert store.leftovers(older_than_s=3600) == left


def test_a_put_into_a_disk_that_goes_meanwhile_has_failed(store: Blobs, tmp_path: Path) -> None:
    class Content(io.BytesIO):
        def read(self, size: int | None = -1) -> bytes:
            (tmp_path / "blobs").rename(tmp_path / "gone")
            return super().read(size)

    store.make_mark("ours")
    with pytest.raises(StoreUnavailable, match="is it still mounted"):
        store.put("jobs/j/image.exr", Content())


def is_put(store: Blobs, name: str, content: bytes) -> bool:
    """Whether there was room for the blob."""
    try:
        store.put(name, content)
    except StoreUnavailable:
        return False
    return True


def files_below(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]
