"""Analytic scenes: what is read of them without a renderer, and what is refused by name."""

import io
import json
from typing import Any

import pytest

from plateau.farm.bundle import BundleError, inspect_bundle, unpack_bundle
from plateau.farm.bundle.analytic import AnalyticScene, read_analytic_scene
from plateau.farm.bundle.formats import formats
from plateau.farm.bundle.limits import BundleLimits
from plateau.farm.model.renderers import renderers


def _file(**fields: Any) -> io.BytesIO:
    return io.BytesIO(json.dumps({"analytic": 1, **fields}).encode())


def test_every_renderer_has_a_format() -> None:
    assert [one.renderer for one in formats()] == list(renderers())


def test_a_scene_says_its_size_and_its_parameters() -> None:
    found = inspect_bundle(_file(width=40, light="ramp"), parameters={"height": "24"})
    assert (found.kind, found.renderer, found.entry) == ("json", "analytic", "scene.json")
    assert (found.width, found.height, found.sensors, found.files) == (40, 24, 1, 1)
    assert found.parameters == {
        "width": "40",
        "height": "64",
        "light": "ramp",
        "noise": "gaussian",
        "level": "0.5",
        "additive": "false",
        "alpha": "false",
    }


def test_a_parameter_takes_the_place_of_its_field() -> None:
    given = {"light": "grey", "level": "2", "additive": "true", "width": "8"}
    scene, _ = read_analytic_scene(_file(width=40, level=0.1), given, BundleLimits())
    assert scene == AnalyticScene(width=8, light="grey", level=2.0, additive=True)


def test_it_is_unpacked_as_it_is(tmp_path) -> None:
    upload = _file(width=40)
    assert unpack_bundle(upload, tmp_path / "scene") == "scene.json"
    assert (tmp_path / "scene" / "scene.json").read_bytes() == upload.getvalue()


@pytest.mark.parametrize(
    ("content", "code", "words"),
    [
        (b"{}", "not-a-scene", '"analytic": 1'),
        (b'{"analytic": 2}', "not-a-scene", '"analytic": 1'),
        (b'{"analytic": 1', "not-a-scene", "begins as JSON does"),
        (b'{"a":' * 9000, "not-a-scene", "begins as JSON does"),
        (b"{" + b" " * 2**16 + b"}", "too-large", "at most 65536 bytes"),
        (b'{"analytic": 1, "lights": "grey"}', "analytic-field", "'lights'.*width, height, light"),
        (b'{"analytic": 1, "light": "sun"}', "analytic-field", "light must be one of grey"),
        (b'{"analytic": 1, "light": ["grey"]}', "analytic-field", "light must be one of grey"),
        (b'{"analytic": 1, "noise": "pink"}', "analytic-field", "noise must be one of gaussian"),
        (b'{"analytic": 1, "width": 0}', "analytic-field", "width must be a whole number"),
        (b'{"analytic": 1, "width": 8.0}', "analytic-field", "width must be a whole number"),
        (b'{"analytic": 1, "height": true}', "analytic-field", "height must be a whole number"),
        (b'{"analytic": 1, "level": NaN}', "analytic-field", "level must be a number"),
        (b'{"analytic": 1, "level": 1e999}', "analytic-field", "level must be a number"),
        (b'{"analytic": 1, "level": -1}', "analytic-field", "level must be a number"),
        (b'{"analytic": 1, "additive": 1}', "analytic-field", "additive must be true or false"),
        (b'{"analytic": 1, "width": 99999, "height": 99999}', "film-size", "too large"),
    ],
)
def test_what_is_wrong_is_named(content: bytes, code: str, words: str) -> None:
    with pytest.raises(BundleError, match=words) as caught:
        inspect_bundle(io.BytesIO(content))
    assert caught.value.code == code


@pytest.mark.parametrize(
    ("asked", "code"),
    [
        ({"parameters": {"spp": "4"}}, "unknown-parameter"),
        ({"parameters": {"width": "wide"}}, "analytic-field"),
        ({"parameters": {"level": "[" * 100_000}}, "analytic-field"),
        ({"sensor": 1}, "no-sensor"),
    ],
)
def test_what_a_job_asks_wrongly_is_named(asked: dict[str, Any], code: str) -> None:
    with pytest.raises(BundleError) as caught:
        inspect_bundle(_file(), **asked)
    assert caught.value.code == code
