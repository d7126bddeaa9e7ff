"""Unpacking: what comes out, that it is what the archive declared, and that it stays inside."""

import io
import stat
import zipfile
from pathlib import Path

import pytest

from plateau.farm.bundle import BundleError, BundleLimits, unpack_bundle
from tests.support.scenes.bundles import PLY, link, mesh, scene, zipped


def test_a_zip_is_unpacked_with_plain_permissions(tmp_path: Path):
    script = zipfile.ZipInfo("room/run.sh")
    script.external_attr = (stat.S_IFREG | 0o6777) << 16
    files = {"room/scene.xml": scene(mesh("a/b.ply")), "room/a/b.ply": PLY, script: b"#!/bin/sh"}
    folder = tmp_path / "new" / "bundle"

    assert unpack_bundle(zipped({"empty/": b"", **files}), folder) == "room/scene.xml"

    assert (folder / "room/a/b.ply").read_bytes() == PLY
    modes = {
        path.relative_to(folder).as_posix(): stat.S_IMODE(path.lstat().st_mode)
        for path in folder.rglob("*")
    }
    assert modes == {
        "empty": 0o755,
        "room": 0o755,
        "room/a": 0o755,
        "room/a/b.ply": 0o644,
        "room/run.sh": 0o644,
        "room/scene.xml": 0o644,
    }


def test_a_folder_with_something_in_it_is_left_alone(tmp_path: Path):
    (tmp_path / "scene.xml").write_text("mine")
    with pytest.raises(FileExistsError):
        unpack_bundle(io.BytesIO(scene()), tmp_path)
    assert (tmp_path / "scene.xml").read_text() == "mine"


def test_the_directory_is_checked_again(tmp_path: Path):
    upload = zipped({"scene.xml": scene(), link("away"): b"/etc"})
    with pytest.raises(BundleError, match="a link"):
        unpack_bundle(upload, tmp_path / "bundle")
    assert list((tmp_path / "bundle").iterdir()) == []


BOMB = bytes(2**20)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("file_size", 100),  # declared small, so as to pass the limits: a bomb
        ("file_size", len(BOMB) + 1),
        ("CRC", 0),
        ("compress_size", 100),
        ("header_offset", 7),
        ("header_offset", 0),  # another entry's data
        ("header_offset", 10**9),
        ("compress_type", zipfile.ZIP_STORED),
    ],
)
def test_an_archive_that_lies_is_found_out_while_it_is_read(tmp_path: Path, field: str, value: int):
    upload = zipped(
        {"scene.xml": scene(), "bomb.bin": BOMB},
        forge=lambda records: setattr(records[1], field, value),
    )
    with pytest.raises(BundleError) as caught:
        unpack_bundle(upload, tmp_path, BundleLimits(max_ratio=10**9))
    assert caught.value.code == "zip-malformed"
    assert caught.value.file == "bomb.bin"
    declared_bytes = value if field == "file_size" else len(BOMB)
    written_bytes = sum(path.stat().st_size for path in tmp_path.glob("bomb.bin"))
    assert written_bytes <= declared_bytes


def test_damaged_data_is_found_out(tmp_path: Path):
    content = bytearray(zipped({"scene.xml": scene(), "a.ply": PLY * 100}).getvalue())
    content[content.index(b"a.ply") + 20] ^= 0xFF
    with pytest.raises(BundleError) as caught:
        unpack_bundle(io.BytesIO(content), tmp_path)
    assert (caught.value.code, caught.value.file) == ("zip-malformed", "a.ply")
