"""The formats of scenes: which file is whose renderer's, and how it is checked without it.

Each renderer of `plateau.farm.model.renderers` has one format here. The first characters of an
upload decide which it is: so the API, which never imports a renderer, checks every scene, and knows
with which variants it can be rendered. A zip holds a Mitsuba scene: no other format has files
beside its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Literal

from plateau.farm.bundle.analytic import read_analytic_scene
from plateau.farm.bundle.entry import SCENE_XML
from plateau.farm.bundle.limits import BundleError, BundleLimits
from plateau.farm.bundle.tree import Parts, Tree
from plateau.farm.bundle.walk import read_scene
from plateau.farm.model.renderers import ANALYTIC, MITSUBA


@dataclass(frozen=True, kw_only=True)
class Checked:
    """What a format's check learned of a scene.

    Attributes
    ----------
    width, height : int
        Pixels of the image of the chosen sensor.
    sensors : int
        How many sensors the scene has.
    parameters : dict of str to str
        The scene's parameters with their defaults.
    """

    width: int
    height: int
    sensors: int
    parameters: dict[str, str]


@dataclass(frozen=True, kw_only=True)
class SceneFormat:
    """The format of a renderer's scenes.

    Attributes
    ----------
    renderer : str
        Whose scenes they are.
    kind : str
        What an upload of one file is called in answers.
    entry : str
        The name that such a file has in its bundle.
    begins : bytes
        The first character of such a file, blanks and a byte order mark left out.
    check : callable
        Returns what it found of the scene in this tree and file, with a job's parameters and
        sensor; raises `BundleError` where the scene is refused.
    """

    renderer: str
    kind: Literal["xml", "json"]
    entry: str
    begins: bytes
    check: Callable[[Tree, Parts, Mapping[str, str], int, BundleLimits], Checked]


def _check_mitsuba(
    tree: Tree, entry: Parts, parameters: Mapping[str, str], sensor: int, limits: BundleLimits
) -> Checked:
    scene = read_scene(tree, entry, parameters, limits)
    scene.parameters.check_all_used()
    width, height = scene.cast.image_size(sensor, limits)
    return Checked(
        width=width,
        height=height,
        sensors=len(scene.cast.sensors),
        parameters=scene.parameters.defaults,
    )


def _check_analytic(
    tree: Tree, entry: Parts, parameters: Mapping[str, str], sensor: int, limits: BundleLimits
) -> Checked:
    with tree.open(entry) as stream:
        scene, own = read_analytic_scene(stream, parameters, limits)
    if sensor != 0:
        raise BundleError(
            "no-sensor", f"the scene has no sensor {sensor}; an analytic one has sensor 0 alone"
        )
    return Checked(width=scene.width, height=scene.height, sensors=1, parameters=own)


MITSUBA_XML: Final = SceneFormat(
    renderer=MITSUBA, kind="xml", entry=SCENE_XML, begins=b"<", check=_check_mitsuba
)

FORMATS: Final = (
    MITSUBA_XML,
    SceneFormat(
        renderer=ANALYTIC, kind="json", entry="scene.json", begins=b"{", check=_check_analytic
    ),
)
