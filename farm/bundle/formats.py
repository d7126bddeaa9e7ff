"""The formats of scenes, one for each renderer, and their checks without the renderer.

The first characters of an upload decide its format: so the API, which never imports a renderer,
checks every scene and knows the variants that can render it. A zip holds a Mitsuba scene, or a
Blender file with what it links to. Analytic scenes are one file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Literal

from plateau.farm.bundle.analytic import read_analytic_scene
from plateau.farm.bundle.blend import BEGINS, SCENE_BLEND, check_blend
from plateau.farm.bundle.entry import SCENE_XML
from plateau.farm.bundle.limits import BundleError, BundleLimits
from plateau.farm.bundle.tree import Parts, Tree
from plateau.farm.bundle.walk import read_scene
from plateau.farm.model.renderers import ANALYTIC, CYCLES, MITSUBA


@dataclass(frozen=True, kw_only=True)
class Checked:
    """What a format's check learned of a scene; `SceneSummary` explains the fields."""

    width: int | None
    height: int | None
    sensors: int
    parameters: dict[str, str]


@dataclass(frozen=True, kw_only=True)
class SceneFormat:
    """The format of a renderer's scenes."""

    renderer: str
    #: `SceneSummary.kind` of an upload of one file
    kind: Literal["xml", "json", "blend"]
    #: of such a file, in HTTP
    media_type: str
    #: the name of such a file in its bundle
    entry: str
    #: the first characters of such a file after blanks and a byte order mark, one of these
    begins: tuple[bytes, ...]
    #: checks the scene in this tree and file, with a job's parameters and sensor, or raises
    #: `BundleError`
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


def _check_blend(
    tree: Tree, entry: Parts, parameters: Mapping[str, str], sensor: int, limits: BundleLimits
) -> Checked:
    with tree.open(entry) as stream:
        width, height = check_blend(stream, parameters, limits)
    if sensor != 0:
        raise BundleError(
            "no-sensor",
            f"the scene has no sensor {sensor}; a Blender file has sensor 0 alone, and other "
            "cameras by the parameter camera",
        )
    return Checked(width=width, height=height, sensors=1, parameters={})


MITSUBA_XML: Final = SceneFormat(
    renderer=MITSUBA,
    kind="xml",
    media_type="application/xml",
    entry=SCENE_XML,
    begins=(b"<",),
    check=_check_mitsuba,
)

BLEND: Final = SceneFormat(
    renderer=CYCLES,
    kind="blend",
    media_type="application/x-blender",
    entry=SCENE_BLEND,
    begins=BEGINS,
    check=_check_blend,
)

FORMATS: Final = (
    MITSUBA_XML,
    BLEND,
    SceneFormat(
        renderer=ANALYTIC,
        kind="json",
        media_type="application/json",
        entry="scene.json",
        begins=(b"{",),
        check=_check_analytic,
    ),
)
