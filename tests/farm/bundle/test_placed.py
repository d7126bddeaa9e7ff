"""Scenes in scene roots: what is found, what is recorded, and what is refused."""

import io
import json
import os
import zipfile
from pathlib import Path

import pytest

from plateau.farm.bundle import BundleError, BundleLimits, inspect_bundle
from plateau.farm.bundle.hashes import FileHashes
from plateau.farm.bundle.placed import LIST_NAME, path_for, with_names, with_paths
from plateau.farm.bundle.placing import find_placed, write_placed
from plateau.farm.model.scene_roots import named_path, read_roots
from tests.support.scenes.bundles import PLY, include, mesh, scene, zipped

LIMITS = BundleLimits()


@pytest.fixture
def studio(tmp_path: Path) -> Path:
    """A storage with two roots, and files outside of them."""
    files = {
        "assets/walk/scene.xml": scene(
            mesh("geometry/hall.ply"),
            mesh("../props/lamp.ply"),
            mesh(f"{tmp_path}/studio/plates/sky.ply"),
            mesh("{plates}/ground.ply"),
            include("../props/light.xml"),
        ),
        "assets/walk/geometry/hall.ply": PLY,
        "assets/props/lamp.ply": PLY + b"\n",
        "assets/props/light.xml": scene(mesh("Z:\\assets\\props\\lamp.ply"), sensor=""),
        "plates/sky.ply": PLY + b"\n\n",
        "plates/ground.ply": PLY,
        "secret/keys.ply": PLY,
    }
    for name, content in files.items():
        path = tmp_path / "studio" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return tmp_path / "studio"


def bundle(studio: Path, name: str, *values: dict[str, str], table: str = "hashes") -> io.BytesIO:
    named = f"assets={studio}/assets|Z:/assets|/Volumes/assets, plates={studio}/plates"
    roots, target = read_roots(named), io.BytesIO()
    found = find_placed(name, roots, values or [{}], LIMITS)
    write_placed(found, roots, FileHashes(studio / table), target)
    target.seek(0)
    return target


def test_a_bundle_holds_the_xml_and_names_every_other_file(studio: Path) -> None:
    made = bundle(studio, "{assets}/walk/scene.xml")
    with zipfile.ZipFile(made) as archive:
        assert sorted(archive.namelist()) == sorted(
            [LIST_NAME, "assets/props/light.xml", "assets/walk/scene.xml"]
        )
        listed = json.loads(archive.read(LIST_NAME))
        text = archive.read("assets/walk/scene.xml").decode()
        light = archive.read("assets/props/light.xml").decode()
    assert listed["entry"] == "assets/walk/scene.xml"
    assert sorted(listed["files"]) == [
        "assets/props/lamp.ply",
        "assets/walk/geometry/hall.ply",
        "plates/ground.ply",
        "plates/sky.ply",
    ]
    assert listed["files"]["plates/sky.ply"]["bytes"] == len(PLY) + 2
    # An absolute path, of this platform or another, became the root's name
    assert '"{plates}/sky.ply"' in text
    assert str(studio) not in text
    assert '"{assets}/props/lamp.ply"' in light
    # It passes the check of an upload, which knows the roots that a worker needs
    summary = inspect_bundle(made)
    assert (summary.roots, summary.files) == (("assets", "plates"), 7)
    assert (summary.entry, summary.kind) == ("assets/walk/scene.xml", "zip")


def test_the_hash_of_a_bundle_is_that_of_its_content(studio: Path) -> None:
    first = bundle(studio, "{assets}/walk/scene.xml").getvalue()
    # Neither a time, nor the way to name the scene, nor where the root lies makes a difference
    os.utime(studio / "plates" / "sky.ply", (1, 1))
    assert bundle(studio, f"{studio}/assets/walk/").getvalue() == first
    assert bundle(studio, "z:\\ASSETS\\walk\\scene.xml").getvalue() == first
    # The content of any file does
    (studio / "plates" / "sky.ply").write_bytes(PLY + b"\n#")
    assert bundle(studio, "{assets}/walk/scene.xml").getvalue() != first


def test_the_files_of_every_set_of_parameters_are_named(studio: Path) -> None:
    (studio / "assets" / "walk" / "many.xml").write_bytes(
        scene('<default name="mesh" value="{plates}/sky"/>', mesh("$mesh.ply"))
    )
    made = bundle(studio, "{assets}/walk/many.xml", {"mesh": "{plates}/ground"}, {})
    with zipfile.ZipFile(made) as archive:
        assert sorted(json.loads(archive.read(LIST_NAME))["files"]) == [
            "plates/ground.ply",
            "plates/sky.ply",
        ]
    assert inspect_bundle(made, parameters={"mesh": "{plates}/ground"}).roots == (
        "assets",
        "plates",
    )


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("{assets}/../secret/scene.xml", "path-escape"),
        ("{assets}/walk/../../secret/scene.xml", "path-escape"),
        ("{secret}/scene.xml", "path-escape"),
        ("/etc/passwd", "path-escape"),
        ("scene.xml", "path-escape"),
        ("{assets}/out/keys.ply", "path-escape"),
        ("{assets}/none.xml", "missing-file"),
        ("{assets}", "missing-file"),
        ("{assets}/pipe", "missing-file"),
        ("{assets}/walk/geometry/hall.ply", "not-a-scene"),
    ],
)
def test_what_lies_elsewhere_is_no_scene(studio: Path, name: str, code: str) -> None:
    (studio / "assets" / "out").symlink_to(studio / "secret")
    os.mkfifo(studio / "assets" / "pipe")
    with pytest.raises(BundleError) as refused:
        bundle(studio, name)
    assert refused.value.code == code


@pytest.mark.parametrize(
    ("reference", "code"),
    [
        ("../../secret/keys.ply", "path-escape"),
        ("../../../secret/keys.ply", "path-escape"),
        ("/etc/passwd", "path-escape"),
        ("{secret}/keys.ply", "missing-file"),
        ("{assets}/../secret/keys.ply", "path-escape"),
        ("out/keys.ply", "path-escape"),
        ("{assets}/walk/out/keys.ply", "path-escape"),
        ("inside/../../props/lamp.ply", "unpackable-path"),
        ("/etc&#47;passwd", "path-escape"),
    ],
)
def test_a_scene_names_no_file_outside_of_the_roots(
    studio: Path, reference: str, code: str
) -> None:
    walk = studio / "assets" / "walk"
    (walk / "out").symlink_to(studio / "secret")
    (walk / "inside").symlink_to(studio / "assets" / "props")
    (walk / "scene.xml").write_bytes(scene(mesh(reference)))
    with pytest.raises(BundleError) as refused:
        bundle(studio, "{assets}/walk/scene.xml")
    assert (refused.value.code, refused.value.line) == (code, 2)


def test_a_link_inside_of_a_root_is_followed(studio: Path) -> None:
    walk = studio / "assets" / "walk"
    (walk / "now").symlink_to("../props")
    (walk / "scene.xml").write_bytes(scene(mesh("now/lamp.ply")))
    with zipfile.ZipFile(bundle(studio, "{assets}/walk/scene.xml")) as archive:
        listed = json.loads(archive.read(LIST_NAME))["files"]
    assert list(listed) == ["assets/walk/now/lamp.ply"]


@pytest.mark.parametrize(
    ("listed", "code"),
    [
        ("[]", "not-a-scene"),
        ('{"placed": 2, "entry": "assets/s.xml", "files": {}}', "not-a-scene"),
        ('{"placed": 1, "entry": "assets/s.xml", "files": {"a": {"bytes": 1}}}', "not-a-scene"),
        ('{"placed": 1, "entry": "assets/t.xml", "files": {}}', "missing-file"),
        ('{"placed": 1, "entry": "assets/s.xml", "files": {"../a": %s}}', "path-escape"),
        ('{"placed": 1, "entry": "assets/s.xml", "files": {"/etc/a": %s}}', "path-escape"),
        (
            '{"placed": 1, "entry": "assets/s.xml", "files": {"assets/s.xml": %s}}',
            "duplicate-entry",
        ),
        ('{"placed": 1, "entry": "assets/s.xml", "files": {"assets": %s}}', "duplicate-entry"),
        ('{"placed": 1, "entry": "assets/s.xml", "files": {"assets/a.so": %s}}', "native-code"),
    ],
)
def test_a_list_is_not_trusted(listed: str, code: str) -> None:
    content = '{"bytes": 1, "sha256": "%s"}' % ("0" * 64)
    upload = zipped({"assets/s.xml": scene(), LIST_NAME: listed.replace("%s", content)})
    with pytest.raises(BundleError) as refused:
        inspect_bundle(upload)
    assert refused.value.code == code


def test_a_file_is_read_once_until_it_changes(
    studio: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, hashes = studio / "plates" / "sky.ply", FileHashes(studio / "hashes")
    now = path.stat().st_ctime_ns + 10**10
    monkeypatch.setattr("plateau.farm.bundle.hashes.time.time_ns", lambda: now)
    first = hashes.content(path)
    monkeypatch.setattr("plateau.farm.bundle.hashes.hashlib.sha256", None)  # it reads no more
    assert FileHashes(studio / "hashes").content(path) == first
    os.utime(path, (1, 1))
    with pytest.raises(TypeError):
        hashes.content(path)


def test_one_that_has_just_changed_is_not_remembered(studio: Path) -> None:
    path, hashes = studio / "plates" / "sky.ply", FileHashes(studio / "hashes")
    before = hashes.content(path)
    status = path.stat()
    path.write_bytes(b"#" + PLY + b"\n")  # the same size
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert hashes.content(path) != before


def test_names_become_paths_of_a_worker_and_back(tmp_path: Path) -> None:
    text = (
        b'<string value="{assets}/a.ply"/><path value=\'{assets}\'/><x value="{assetsb}/{assets}"/>'
    )
    here = with_paths(text, ["assets"], tmp_path / 'the "cache" & more')
    assert b'&quot;cache&quot; &amp; more/assets/a.ply"' in here
    assert b"{assetsb}/{assets}" in here
    assert path_for("{assets}/a", ["assets"], Path("/c")) == "/c/assets/a"
    assert path_for("see {assets}/a", ["assets"], Path("/c")) == "see {assets}/a"
    roots = read_roots("assets=/mnt/assets|Z:/assets")
    assert with_names(b'<a b="/mnt/assets/x" c="/mnt/assetsb/x"/>', roots) == (
        b'<a b="{assets}/x" c="/mnt/assetsb/x"/>'
    )


@pytest.mark.parametrize(
    "text",
    ["assets", "assets=", "assets=/", "as/sets=/mnt", "a=/mnt,a=/srv", "a=/mnt|data", "=/mnt"],
)
def test_a_wrong_root_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"must be|absolute"):
        read_roots(text)


def test_only_whole_folders_count(tmp_path: Path) -> None:
    roots = read_roots("a=/mnt/a,server=/srv|\\\\nas\\share")
    assert named_path("/mnt/ab/s.xml", roots) is None
    assert named_path("\\\\NAS\\share\\s.xml", roots) == ("server", "s.xml")
    assert named_path("{b}/s.xml", roots) is None
