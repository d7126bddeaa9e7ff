"""A recipe in TOML: scenes, their parameters, the target, and how the images are stored.

::

    scenes = ["scenes:box"]
    target = "relmse:target=0.01"
    inputs = [1, 4, 16]
    layout = "oidn"

    [parameters]
    width = 128
    intensity = {from = 5, to = 25, count = 5}
"""

import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any, Final

from plateau.errors import CommandFailed
from plateau.farm.model.scene_roots import at_home
from plateau.farm.model.spec import JobSpec
from plateau.files.frames import each, from_file
from plateau.rendering.mapping import Task, spec_for

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found]

#: How the images are stored: see `plateau.rendering.dataset.layouts`.
LAYOUTS: Final = ("exr", "oidn")
_OF_OIDN: Final = ("albedo", "normal")
_SPACED: Final = {"from", "to", "count"}
#: The fields whose values are of one kind, and that in words.
_KINDS: Final = {
    "scenes": (list, 'a list, such as ["scenes:box"]'),
    "inputs": (list, "a list of samples per pixel, such as [1, 4, 16]"),
    "aovs": (list, 'a list, such as ["albedo"]'),
    "sensors": (list, "a list of indices, such as [0, 1]"),
    "independent": (bool, "true or false"),
    "variance": (bool, "true or false"),
    "layout": (str, "text"),
    "spec": (dict, "a table"),
}


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """What a data set is to have."""

    scenes: tuple[str, ...]  #: paths, seen from the recipe's folder, ``*`` allowed; `scenes:NAME`
    target: Any = "relmse"  #: the rule that ends each image
    inputs: tuple[int, ...] = ()  #: samples per pixel of noisy images that are kept too
    independent: bool = False  #: whether they are of other samples than the image
    aovs: tuple[str, ...] = ()
    variance: bool = False
    layout: str = "exr"
    sensors: tuple[int, ...] = (0,)
    parameters: Any = field(default_factory=dict)
    spec: Mapping[str, Any] = field(default_factory=dict)  #: more fields of the jobs' spec
    folder: Path = Path()  #: of the recipe

    @classmethod
    def read(cls, path: Path) -> "Recipe":
        """The recipe in a file.

        Raises
        ------
        CommandFailed
            The file is no recipe; the message says what to change.
        OSError
            It cannot be read.
        """
        try:
            found = tomllib.loads(path.read_text(encoding="utf-8"))
        except ValueError as error:
            raise CommandFailed(f"{path} is no TOML: {error}") from None
        known = [one.name for one in fields(cls) if one.name != "folder"]
        if unknown := sorted(found.keys() - set(known)):
            raise CommandFailed(
                f"{path}: there is no {unknown[0]!r} in a recipe; it has {', '.join(known)}, and "
                "other fields of a job's spec stand under [spec]"
            )
        for name, (kind, words) in _KINDS.items():
            if not isinstance(found.get(name, kind()), kind):
                raise CommandFailed(f"{path}: {name} must be {words}")
        if not found.get("scenes"):
            raise CommandFailed(f'{path} names no scenes: begin with scenes = ["scenes:box"]')
        if found.get("layout", "exr") not in LAYOUTS:
            raise CommandFailed(f"{path}: layout must be {' or '.join(LAYOUTS)}")
        given: dict[str, Any] = {
            name: tuple(one) if isinstance(one, list) and name in _KINDS else one
            for name, one in found.items()
        }
        return cls(**given, folder=path.absolute().parent)

    @cached_property
    def job_spec(self) -> JobSpec:
        """The spec of all images.

        Raises
        ------
        InvalidSpec
            A value is not allowed.
        CommandFailed
            The layout cannot have such images.
        """
        aovs, most = list(self.aovs), max(self.inputs, default=0)
        if self.layout == "oidn":
            aovs += [name for name in _OF_OIDN if name not in aovs]
        made = spec_for(
            self.target,
            self.inputs,
            independent=self.independent,
            aovs=aovs,
            variance=self.variance,
            fields=self.spec,
        )
        # The image with the most samples is the target.
        if self.layout != "oidn" or not self.inputs:
            return made
        if made.max_spp <= most:
            raise CommandFailed(
                f"the layout oidn takes the image with the most samples for the target: "
                f"{made.max_spp} spp must be above the last of inputs, {most}"
            )
        return made.model_copy(update={"min_spp": max(made.min_spp or 1, most + 1)})

    @property
    def tasks(self) -> Iterator[Task]:
        """The images, in their order: by scene, then parameters, then sensor."""
        combined = product(self._scenes(), self._entries(), self.sensors)
        for index, (scene, values, sensor) in enumerate(combined):
            yield Task(index=index, scene=scene, parameters=values, sensor=sensor)

    def _scenes(self) -> list[str]:
        found: list[str] = []
        for one in self.scenes:
            if one.startswith("scenes:"):
                found.append(one)
            elif "*" not in one:
                found.append(str(self.folder / at_home(one)))
            elif several := sorted(self.folder.glob(one)):
                found += map(str, several)
            else:
                raise CommandFailed(f"there is no scene {one!r} in {self.folder}")
        return found

    def _entries(self) -> list[dict[str, Any]]:
        """The sets of parameters: those of a file, of a list, or every combination."""
        given = self.parameters
        if isinstance(given, str):
            return [dict(one) for one in from_file(self.folder / given)]
        if isinstance(given, list):
            return [dict(one) for one in given] or [{}]
        values = [_values(name, one) for name, one in given.items()]
        return [dict(zip(given, one, strict=True)) for one in product(*values)]


def _values(name: str, given: Any) -> list[Any]:
    """The values of one parameter: one, a list, a range, or evenly spaced ones."""
    if isinstance(given, list):
        return given
    if isinstance(given, Mapping):
        if given.keys() != _SPACED or not isinstance(given["count"], int) or given["count"] < 1:
            raise CommandFailed(
                f"parameters: {name} must be like {{from = 0, to = 1, count = 5}}, with a count of "
                "1 or more"
            )
        first, last, count = given["from"], given["to"], given["count"]
        steps = max(count - 1, 1)
        return [first + (last - first) * step / steps for step in range(count)]
    if isinstance(given, str) and ".." in given:
        return [one[name] for one in each([f"{name}={given}"])]
    return [given]
