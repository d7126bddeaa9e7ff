"""The formats of scenes, one for each renderer, and their checks without the renderer.

The first characters of an upload decide its format: so the API, which never imports a renderer,
checks every scene and knows the variants that can render it. A zip holds a Mitsuba scene, or one of
another format whose files have a suffix of their own, with what the scene needs.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pkgutil import resolve_name
from typing import Final

from plateau.farm.bundle.archive import Archive
from plateau.farm.bundle.limits import BundleLimits
from plateau.farm.bundle.tree import Parts, Tree
from plateau.farm.bundle.walk import read_scene
from plateau.farm.model.renderers import MITSUBA, renderers


@dataclass(frozen=True, kw_only=True)
class Checked:
    """What a format's check learned of a scene."""

    #: size of the image in pixels: the film of the chosen sensor, or its crop window; None where
    #: the renderer alone can tell
    width: int | None
    height: int | None
    #: number of sensors
    sensors: int
    #: whether only variants that leave whole films to the renderer can render it
    is_whole: bool = False
    #: the scene's parameters with their defaults
    parameters: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class SceneFormat:
    """The format of a renderer's scenes."""

    renderer: str
    #: `SceneSummary.kind` of an upload of one file
    kind: str
    #: what people call such a file, with its article
    called: str
    #: of such a file, in HTTP
    media_type: str
    #: the name of such a file in its bundle, and of the scene where a folder has several
    entry: str
    #: the first characters of such a file after blanks and a byte order mark, one of these
    begins: tuple[bytes, ...]
    #: checks the scene in a tree and file, with parameters and sensor, or raises `BundleError`
    check: Callable[[Tree, Parts, Mapping[str, str], int, BundleLimits], Checked]
    #: how the names of such files end, in lower case, if a zip or a folder with one may be a scene;
    #: such a folder is packed whole
    suffix: str = ""
    #: the suffixes of files that are left out when a folder is packed
    left_out: re.Pattern[str] | None = None
    #: whether such files are not worth compressing
    is_compressed: bool = False

    def is_named(self, path: Parts) -> bool:
        """Return whether a file has the suffix of this format."""
        return bool(self.suffix) and path[-1].casefold().endswith(self.suffix)


def _check_mitsuba(
    tree: Tree, entry: Parts, parameters: Mapping[str, str], sensor: int, limits: BundleLimits
) -> Checked:
    scene = read_scene(tree, entry, parameters, limits)
    scene.parameters.check_all_used()
    if isinstance(tree, Archive):
        from plateau.farm.bundle.contents import check_contents  # numpy takes its time

        check_contents(tree, scene.references)
    width, height = scene.cast.image_size(sensor, limits)
    return Checked(
        width=width,
        height=height,
        sensors=len(scene.cast.sensors),
        parameters=scene.parameters.defaults,
        is_whole=scene.is_whole,
    )


MITSUBA_XML: Final = SceneFormat(
    renderer=MITSUBA,
    kind="xml",
    called="a Mitsuba XML",
    media_type="application/xml",
    entry="scene.xml",
    begins=(b"<",),
    check=_check_mitsuba,
)


@cache
def formats() -> tuple[SceneFormat, ...]:
    """Return the formats of the installed renderers, in their order.

    Raises
    ------
    ImportError
        A renderer names no format.
    """
    found = []
    for renderer in renderers().values():
        one = resolve_name(renderer.scenes)
        if not (isinstance(one, SceneFormat) and one.renderer == renderer.name):
            raise ImportError(f"{renderer.scenes} is no SceneFormat of {renderer.name}")
        found.append(one)
    return tuple(found)


def with_suffix() -> tuple[SceneFormat, ...]:
    """Return those of which a zip or a folder may hold a scene, besides Mitsuba's."""
    return tuple(one for one in formats() if one.suffix)


def format_named(path: Parts) -> SceneFormat:
    """Return the format of the scene's file in a zip, by its name."""
    return next((one for one in with_suffix() if one.is_named(path)), MITSUBA_XML)
