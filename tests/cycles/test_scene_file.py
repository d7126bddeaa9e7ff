"""Blender files, as far as they are known without Blender."""

import gzip
import io
from pathlib import Path

import httpx
import pytest

from plateau.farm.bundle import BundleError, inspect_bundle, unpack_bundle
from plateau.files.packing import pack
from tests.plateau.files.test_packing import names
from tests.service.api.routes.test_scenes import check
from tests.support.api_calls import problem
from tests.support.scenes.bundles import scene, zipped

#: How Blender 5 begins a file, and how Zstandard does.
BLEND = b"BLENDER17-01v0501" + bytes(100)
ZSTANDARD = b"\x28\xb5\x2f\xfd" + bytes(100) + b"\xb1\xea\x92\x8f"


@pytest.mark.parametrize(
    "content", [BLEND, ZSTANDARD, gzip.compress(BLEND, mtime=0)], ids=["plain", "zstd", "gzip"]
)
def test_it_is_known_by_its_first_characters(content, tmp_path):
    found = inspect_bundle(io.BytesIO(content))
    assert (found.kind, found.renderer, found.entry) == ("blend", "cycles", "scene.blend")
    # Blender alone knows more
    assert (found.width, found.height, found.sensors, found.parameters) == (None, None, 1, {})
    assert unpack_bundle(io.BytesIO(content), tmp_path / "scene") == "scene.blend"
    assert (tmp_path / "scene" / "scene.blend").read_bytes() == content


def test_parameters_set_what_is_known():
    given = {"width": "40", "height": "30", "frame": "-12", "camera": "Über uns"}
    found = inspect_bundle(io.BytesIO(BLEND), parameters=given)
    assert (found.width, found.height) == (40, 30)


@pytest.mark.parametrize(
    ("content", "given", "sensor", "code", "says"),
    [
        (
            gzip.compress(b"text", mtime=0),
            {},
            0,
            "not-a-scene",
            "a file compressed by gzip; unpack it",
        ),
        (b"\x1f\x8b" + bytes(50), {}, 0, "not-a-scene", "a file compressed by gzip"),
        (BLEND, {"samples": "4"}, 0, "unknown-parameter", "has width, height, frame, camera"),
        (BLEND, {"width": "0"}, 0, "bad-parameter", "width must be a whole number"),
        (BLEND, {"height": "1e3"}, 0, "bad-parameter", "height must be a whole number"),
        (BLEND, {"frame": "2000000"}, 0, "bad-parameter", "frame must be a whole number"),
        (BLEND, {"camera": "\n"}, 0, "bad-parameter", "camera must be the name of a camera"),
        (BLEND, {"width": "9000", "height": "9000"}, 0, "film-size", "9000×9000 pixels is too"),
        (BLEND, {}, 1, "no-sensor", "other cameras by the parameter camera"),
    ],
)
def test_what_it_cannot_be_is_refused_at_the_door(content, given, sensor, code, says):
    with pytest.raises(BundleError, match=says) as refused:
        inspect_bundle(io.BytesIO(content), parameters=given, sensor=sensor)
    assert refused.value.code == code


def _in_zip(**files: bytes) -> str:
    return inspect_bundle(zipped(files)).entry


def test_a_zip_may_have_one_with_what_it_links_to():
    files = {"shot/shot.blend": BLEND, "shot/textures/wood.png": b"\x89PNG"}
    found = inspect_bundle(zipped(files))
    assert (found.kind, found.renderer, found.entry) == ("zip", "cycles", "shot/shot.blend")
    # Of several, one has the name
    assert _in_zip(**{"scene.blend": BLEND, "props.blend": BLEND}) == "scene.blend"
    with pytest.raises(BundleError, match=r"name the right one scene\.blend"):
        _in_zip(**{"shot.blend": BLEND, "props.blend": BLEND})
    # A Mitsuba scene may have the Blender file beside it from which it was made
    assert _in_zip(**{"scene.xml": scene(), "shot.blend": BLEND}) == "scene.xml"


def test_a_folder_with_a_blender_file_is_packed_whole(tmp_path: Path):
    files = ("shot.blend", "shot.blend2", "textures/wood.png", ".git/config")
    for name in files:
        (tmp_path / "shot" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "shot" / name).write_bytes(b"BLENDER17-01v0501")
    with pack(tmp_path / "shot") as packed:
        assert names(packed) == ["shot.blend", "textures/wood.png"]
        assert packed.name == "shot.zip"
        assert inspect_bundle(packed.file).renderer == "cycles"
    # The file alone is sent as it is
    with pack(tmp_path / "shot" / "shot.blend") as packed:
        assert (packed.media_type, packed.name) == ("application/x-blender", "shot.blend")
    # Of several, one has to have the name
    (tmp_path / "shot" / "props.blend").write_bytes(b"BLENDER17-01v0501")
    with pytest.raises(BundleError, match=r"props\.blend, shot\.blend\); name the right one"):
        pack(tmp_path / "shot")
    (tmp_path / "shot" / "shot.blend").rename(tmp_path / "shot" / "scene.blend")
    with pack(tmp_path / "shot") as packed:
        assert packed.name == "shot.zip"


def test_what_a_blender_file_holds_is_not_known_yet(http: httpx.Client) -> None:
    blend = "BLENDER17-01v0501"
    found = check(http, scene=blend).json()
    assert (found["kind"], found["width"], found["height"]) == ("blend", None, None)
    sized = check(http, scene=blend, spec='{"parameters": {"width": 32, "height": 16}}').json()
    assert (sized["width"], sized["height"]) == (32, 16)
    answer = http.post("/v1/jobs", files={"scene": ("shot.blend", blend)}, data={"spec": "{}"})
    assert (answer.status_code, answer.json()["spec"]["variant"]) == (201, "cycles:cpu")
    # So it cannot be allocated by zones, nor be a shot of which nobody knows the size
    by_zones = check(http, scene=blend, spec='{"allocation": {"name": "zones"}}')
    assert "whole films alone" in problem(by_zones, 422, "invalid-spec")["detail"]
    frames = '{"batch": "b", "shot": {"fps": 24}, "parameters": [{"frame": 1}, {"frame": 2}]}'
    shot = check(http, scene=blend, spec=frames)
    assert "set the parameters width and height" in problem(shot, 422, "invalid-spec")["detail"]


def test_what_is_refused_is_refused_as_with_a_job(http: httpx.Client) -> None:
    problem(check(http, scene="<scene"), 422, "broken-scene")
    problem(http.post("/v1/scenes", files={"spec": (None, "{}")}), 422, "no-scene")
    problem(http.post("/v1/scenes", json={}), 415, "not-multipart")
