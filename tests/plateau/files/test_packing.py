"""A scene on the disk becomes one file that renders the same somewhere else."""

import hashlib
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from plateau.farm.bundle import BundleError, inspect_bundle, unpack_bundle
from plateau.files.packing import Packed, pack
from tests.support.scenes.bundles import PLY, PNG, include, mesh, scene, zipped


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A scene two folders down, with files beside it, below it and above it."""
    files = {
        "shots/one/shot.xml": scene(
            '<default name="mesh" value="low"/>',
            '<path value="geometry"/>',
            mesh("$mesh.ply"),
            include("../../shared/light.xml"),
            '<bsdf type="diffuse"><texture type="bitmap" name="reflectance">'
            '<string name="filename" value="../../shared/wood.png"/></texture></bsdf>',
            '<bsdf type="diffuse"><spectrum name="reflectance" filename="grey.spd"/></bsdf>',
        ),
        "shots/one/geometry/low.ply": PLY,
        "shots/one/geometry/high.ply": PLY + b"\n",
        "shots/one/grey.spd": b"400 0.5\n700 0.5\n",
        "shared/light.xml": scene(include("colours/white.xml"), sensor=""),
        "shared/colours/white.xml": scene(sensor=""),
        "shared/wood.png": PNG,
        "shared/unused.exr": b"",
        "shots/two/scene.xml": scene(),
    }
    for name, content in files.items():
        path = tmp_path / "project" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return tmp_path / "project"


def names(packed: Packed) -> list[str]:
    with zipfile.ZipFile(packed.file) as archive:
        return archive.namelist()


def sha256(path: Path, **parameters: str) -> str:
    with pack(path, parameters) as packed:
        return hashlib.sha256(packed.file.read()).hexdigest()


def test_all_that_a_scene_refers_to_is_packed_in_its_place(project: Path):
    with pack(project / "shots" / "one" / "shot.xml") as packed:
        assert (packed.name, packed.media_type) == ("shot.zip", "application/zip")
        assert names(packed) == [
            "shared/colours/white.xml",
            "shared/light.xml",
            "shared/wood.png",
            "shots/one/geometry/low.ply",
            "shots/one/grey.spd",
            "shots/one/shot.xml",
        ]
        assert {path.name for path in packed.files} == {Path(n).name for n in names(packed)}
        assert inspect_bundle(packed.file).entry == "shots/one/shot.xml"


def test_parameters_choose_what_is_packed(project: Path):
    with pack(project / "shots" / "one" / "shot.xml", {"mesh": "high"}) as packed:
        assert "shots/one/geometry/high.ply" in names(packed)
        assert "shots/one/geometry/low.ply" not in names(packed)


def test_a_scene_without_references_is_sent_as_it_is_under_its_folder_s_name(project: Path):
    path = project / "shots" / "two" / "scene.xml"
    with pack(path) as packed:
        assert (packed.name, packed.media_type, packed.files) == (
            "two.xml",
            "application/xml",
            (path,),
        )
        assert packed.file.read() == path.read_bytes()


@pytest.mark.parametrize("damage", [slice(4, None), slice(0, 40)])
def test_a_zip_that_is_damaged_is_called_so(tmp_path: Path, damage: slice):
    path = tmp_path / "room.zip"
    path.write_bytes(zipped({"scene.xml": scene()}).getvalue()[damage])
    with pytest.raises(BundleError, match="damaged"), pack(path) as packed:
        inspect_bundle(packed.file)


def test_the_same_scene_has_the_same_bytes(project: Path, tmp_path: Path):
    path = project / "shots" / "one" / "shot.xml"
    before = sha256(path)

    # Neither times, nor permissions, nor neighbours, nor the place of it all make a difference;
    os.utime(path, (0, 0))
    path.chmod(0o600)
    (project / "shared" / "new.png").write_bytes(b"new")
    project.rename(tmp_path / "moved")
    path = tmp_path / "moved" / "shots" / "one" / "shot.xml"
    assert sha256(path) == before

    # a file's contents do.
    (tmp_path / "moved" / "shared" / "wood.png").write_bytes(b"oak")
    assert sha256(path) != before


def test_what_is_even_is_no_bomb(project: Path):
    (project / "shots/one/geometry/high.ply").write_bytes(PLY + bytes(2_000_000))
    with pack(project / "shots" / "one" / "shot.xml", values := {"mesh": "high"}) as packed:
        assert inspect_bundle(packed.file, parameters=values).files == 6


def test_a_path_from_the_working_folder_is_as_good(project: Path, monkeypatch: pytest.MonkeyPatch):
    expected = sha256(project / "shots" / "one" / "shot.xml")
    monkeypatch.chdir(project / "shots" / "two")
    assert sha256(Path("../one/shot.xml")) == expected


def test_folders_that_a_reference_goes_through_are_packed(tmp_path: Path):
    """Mitsuba finds nothing by `empty/../a.ply` where there is no folder `empty`."""
    (tmp_path / "empty").mkdir()
    (tmp_path / "a.ply").write_bytes(PLY)
    (tmp_path / "scene.xml").write_bytes(scene(mesh("empty/../a.ply")))
    with pack(tmp_path) as packed:
        assert names(packed) == ["empty/", "a.ply", "scene.xml"]
        assert inspect_bundle(packed.file).files == 2


def test_a_folder_that_is_searched_in_vain_stays_inside(tmp_path: Path):
    """Seen from `meshes`, the texture would lie above the scene's folder: that counts, too."""
    room = tmp_path / "top" / "room"
    (room / "meshes").mkdir(parents=True)
    (tmp_path / "top" / "a.ply").write_bytes(PLY)
    (room / "scene.xml").write_bytes(scene('<path value=".."/>', mesh("../top/a.ply")))
    with pack(room) as packed:
        assert inspect_bundle(packed.file).entry == "top/room/scene.xml"


def test_files_behind_links_are_packed_as_files(tmp_path: Path):
    (tmp_path / "store").mkdir()
    (tmp_path / "store" / "a.ply").write_bytes(PLY)
    (tmp_path / "room").mkdir()
    (tmp_path / "room" / "meshes").symlink_to(tmp_path / "store")
    (tmp_path / "room" / "scene.xml").write_bytes(scene(mesh("meshes/a.ply")))
    with pack(tmp_path / "room") as packed:
        assert names(packed) == ["meshes/a.ply", "scene.xml"]
        inspect_bundle(packed.file)


@pytest.mark.parametrize(
    ("body", "code", "says"),
    [
        (mesh("no.ply"), "missing-file", "'no.ply' does not exist"),
        (mesh("link/../a.ply"), "unpackable-path", "a folder that is a link"),
        ("{absolute}", "unpackable-path", "is an absolute path"),
        (mesh("$what"), "undefined-parameter", "has no value"),
    ],
)
def test_what_cannot_be_packed_is_named_with_its_line(
    tmp_path: Path, body: str, code: str, says: str
):
    (tmp_path / "far" / "away").mkdir(parents=True)
    (tmp_path / "far" / "a.ply").write_bytes(PLY)
    (tmp_path / "a.ply").write_bytes(PLY + b"another")
    (tmp_path / "link").symlink_to(tmp_path / "far" / "away")
    path = tmp_path / "scene.xml"
    path.write_bytes(scene("", body.format(absolute=mesh(str(tmp_path / "far" / "a.ply")))))
    with pytest.raises(BundleError, match=says) as caught:
        pack(path)
    assert caught.value.code == code
    assert (caught.value.file, caught.value.line) == (str(path), 3)


@pytest.mark.parametrize("name", ["nowhere.xml", "."])
def test_a_scene_that_is_not_there_is_named(tmp_path: Path, name: str):
    with pytest.raises(BundleError, match="no such file") as caught:
        pack(tmp_path / name)
    assert caught.value.code == "missing-file"


def test_a_bundle_in_which_the_farm_would_take_another_scene_is_refused(tmp_path: Path):
    """Without the job's parameters it cannot be seen that the scene includes the other file."""
    (tmp_path / "scene.xml").write_bytes(scene(sensor=""))
    (tmp_path / "main.xml").write_bytes(scene(include("$part.xml")))
    with pytest.raises(BundleError, match=r"main\.xml: .*take scene\.xml for the scene") as caught:
        pack(tmp_path / "main.xml", {"part": "scene"})
    assert caught.value.code == "ambiguous-scene"


_LOAD = """
import json, sys
import mitsuba as mi
mi.set_variant("scalar_rgb")
scene = mi.load_file(sys.argv[1])
film = scene.sensors()[0].film()
print("\\n" + json.dumps([len(scene.shapes()), *film.size()]))
"""


def test_mitsuba_loads_what_was_packed_checked_and_unpacked(project: Path, tmp_path: Path):
    Image.fromarray(np.zeros((2, 2, 3), np.uint8)).save(project / "shared" / "wood.png")
    with pack(project / "shots" / "one" / "shot.xml") as packed:
        summary = inspect_bundle(packed.file)
        entry = unpack_bundle(packed.file, tmp_path / "unpacked")
    process = subprocess.run(
        [sys.executable, "-c", _LOAD, str(tmp_path / "unpacked" / entry)],
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
    )
    loaded = json.loads(process.stdout.splitlines()[-1])
    assert loaded == [1, summary.width, summary.height]
