"""Mistakes in a first scene of one's own: each message says what is wrong, where, what to do."""

import re
from pathlib import Path
from typing import Any, Final

import pytest

from plateau.errors import PlateauError
from plateau.farm.bundle import BundleError
from plateau.rendering import own_farm
from tests.support.farms.real_farm import RealFarm
from tests.support.processes.commands import plateau
from tests.support.processes.mitsuba_process import MitsubaProcess
from tests.support.scenes.mistakes import IN_A_FILE, XML, mistaken

SAMPLER: Final = '<sampler type="independent"><integer name="sample_count" value="64"/></sampler>'

#: A change of the dict's ball or of another part, and what is said of it, likewise.
IN_A_DICT: Final[dict[str, tuple[dict[str, Any], str]]] = {
    "a missing texture": (
        {"ball": {"type": "sphere", "bsdf": {"type": "twosided", "filename": "wood.png"}}},
        r"^ball\.bsdf\.filename names 'wood\.png', which is not in .*: put it there, or give its",
    ),
    "a wrong name of a plugin": (
        {"ball": {"type": "sphere", "bsdf": {"type": "difuse"}}},
        r"^ball\.bsdf has the type 'difuse', .* did you mean 'diffuse'\?",
    ),
    "a plugin of Mitsuba 0.6": (
        {"integrator": {"type": "photonmapper"}},
        r"^integrator has the type 'photonmapper', .*; it is one of Mitsuba 0\.6: use 'path'",
    ),
    "no camera": ({"sensor": None}, r"^the scene has no camera; add a <sensor>"),
    "a path of Windows": (
        {"ball": {"type": "sphere", "filename": r"C:\art\wood.png"}},
        r"^ball\.filename names .* put it there, or give its whole path; write / between folders",
    ),
    "a typo in 'type'": ({"ball": {"typ": "sphere"}}, r"^ball has no 'type'; it has 'typ'"),
    # What Mitsuba alone can tell, and with it a job's reason
    "a typo in a property": (
        {"ball": {"type": "sphere", "bsdf": {"type": "diffuse", "reflectanse": 1.0}}},
        r"(?s), ball\.bsdf: .*\"reflectanse\".* no such property: correct its name, or delete it\.",
    ),
    "a reference to nothing": (
        {"ball": {"type": "sphere", "bsdf": {"type": "ref", "id": "wod"}}},
        r", ball: unresolved reference to \"wod\" .* Make sure the object with id=\"wod\" exists",
    ),
    "no light": ({"sky": None}, r"the image is black: the scene has no emitter; add one"),
}


def _scene(**parts: object) -> dict[str, Any]:
    film = {"type": "hdrfilm", "width": 16, "height": 16}
    sensor = {"type": "perspective", "film": film}
    whole = {"type": "scene", "integrator": {"type": "path"}, "sensor": sensor} | {
        "sky": {"type": "constant"},
        "ball": {"type": "sphere"},
    }
    return {name: part for name, part in (whole | parts).items() if part is not None}


def _said(scene: dict[str, Any], farm: str) -> str:
    """What `plateau.render` says of a scene, in a process that has Mitsuba."""
    import plateau as package

    try:
        package.render(scene, farm=farm, max_spp=100, progress=False)
    except (BundleError, PlateauError) as error:
        return str(error)
    return "nothing"


@pytest.mark.parametrize("mistake", IN_A_FILE)
@pytest.mark.parametrize("command", ["render", "submit"])
def test_in_a_file(
    shared_farm: RealFarm,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    command: str,
    mistake: str,
) -> None:
    (tmp_path / "scene.xml").write_text(mistaken(mistake))
    (tmp_path / "art").mkdir()
    (tmp_path / "art" / "oak.png").touch()
    (tmp_path / "art" / "sky.xml").touch()
    monkeypatch.setenv("PLATEAU_URL", shared_farm.url)
    monkeypatch.setattr(own_farm, "rendered_alone", None)  # nothing is started for it
    code, _, said = plateau(command, str(tmp_path / "scene.xml"))
    assert (code, len(said.splitlines())) == (1, 1)
    assert re.search(IN_A_FILE[mistake][1], said), said


@pytest.mark.parametrize("mistake", IN_A_DICT)
def test_in_a_dict(staffed: RealFarm, scalar: MitsubaProcess, mistake: str) -> None:
    change, says = IN_A_DICT[mistake]
    said = scalar.call(_said, _scene(**change), staffed.url)
    assert re.search(says, said), said


def test_samples_of_the_scene_are_no_mistake_but_a_note(
    staffed: RealFarm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PLATEAU_URL", staffed.url)
    (tmp_path / "scene.xml").write_text(XML.replace("<film", f"{SAMPLER}<film"))
    job = staffed.submit(tmp_path / "scene.xml", step=32, max_spp=32)
    _, _, said = plateau("watch", job.id)
    assert said.count("note: the sampler's sample_count of 64 was ignored") == 1
    assert "'fixed' renders as many as you ask for" in said
