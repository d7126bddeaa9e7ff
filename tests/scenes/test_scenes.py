"""The example scenes: known files that pass the farm's check, well exposed under their light."""

import hashlib
import json
import subprocess
import sys
from functools import cache

import pytest

from plateau import scenes
from plateau.farm.bundle import inspect_bundle
from plateau.files.packing import pack

#: Of each family: the SHA-256 of its files, the median of each pixel's brightest channel at EV 0
#: under the bright light, and the most pixels beyond white.
FACTS = {
    "bar": ("0badd1110ebfeb6eed5f252e4cab862cc2cb04c20a9f22b248ee6bf84f3097f1", 0.25, 0.07),
    "box": ("b5ee714379537e3f8c0915bbd9f54784ec7ddc5989ac89d1da0af6712decc929", 0.34, 0.04),
    "oculist": ("de7f576bdc4468dc1add5962ebef4e1230cac6055ecbb6e3180b1fbda6a21128", 0.28, 0.05),
    "plants": ("db1e83fba134c070a7476c9b5c9279654318863be0d629ac18ac4cbb7af6076f", 0.23, 0.05),
}
RENDER = """
import json, sys
import mitsuba as mi, numpy as np
mi.set_variant("scalar_rgb")
found = {}
for path in sys.argv[1:]:
    scene = mi.load_file(path, width=32, height=32)
    brightest = np.array(mi.render(scene, spp=64)).max(axis=2)
    found[path] = float(np.median(brightest)), float((brightest > 1).mean())
print("\\n" + json.dumps(found))
"""


def digest(family: str) -> str:
    """The SHA-256 of the names and contents of a scene's files."""
    folder, sha256 = scenes.FOLDER / family, hashlib.sha256()
    for path in [folder / "scene.xml", *sorted(folder.glob("[mt]*/*"))]:
        sha256.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    return sha256.hexdigest()


@cache
def rendered() -> dict[str, tuple[float, float]]:
    """What `scalar_rgb` makes of each scene at 32 × 32 pixels and 64 spp."""
    paths = [str(scenes.FOLDER / family / "scene.xml") for family in FACTS]
    command = [sys.executable, "-c", RENDER, *paths]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return dict(zip(FACTS, json.loads(said.splitlines()[-1]).values(), strict=True))


def test_every_family_has_a_name() -> None:
    found = {path.parent.name for path in scenes.FOLDER.glob("*/scene.xml")}
    assert found == set(scenes.NAMES) == set(FACTS)


@pytest.mark.parametrize("family", scenes.NAMES)
class TestEveryFamily:
    def test_has_the_files_on_which_everything_was_measured(self, family: str) -> None:
        assert digest(family) == FACTS[family][0]

    def test_is_well_exposed_at_ev_0(self, family: str) -> None:
        median, clipped = rendered()[family]
        _, expected, most_clipped = FACTS[family]
        assert median == pytest.approx(expected, rel=0.15)
        assert clipped < most_clipped

    def test_passes_the_farms_check(self, family: str) -> None:
        given = {"width": "128", "intensity": "3"}
        with pack(scenes.FOLDER / family) as packed:
            summary = inspect_bundle(packed.file, parameters=given)
        assert (summary.entry, summary.sensors) == ("scene.xml", 1)
        assert (summary.width, summary.height) == (128, 512)
        assert summary.bytes_unpacked < 2_000_000
        assert summary.parameters["width"] == summary.parameters["height"] == "512"
        assert summary.parameters["intensity"] == f"{scenes.LIGHTS[family][0]:g}"
        assert set(summary.parameters) == {"width", "height", "intensity", "max_depth"}

    def test_is_in_the_readme_with_both_lights(self, family: str) -> None:
        readme = (scenes.FOLDER / "README.md").read_text(encoding="utf-8")
        for number, intensity in enumerate(scenes.LIGHTS[family], 1):
            assert f"| {family.upper()} {number} | {intensity:g} |" in readme
