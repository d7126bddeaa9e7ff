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
from functools import cached_property
from glob import glob
from itertools import product
from pathlib import Path
from typing import Any, Final, Literal

from pydantic import Field, ValidationError

from plateau.errors import CommandFailed
from plateau.farm.model import input_errors
from plateau.farm.model.scene_roots import at_home
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.spec.rule_model import Strict
from plateau.files.frames import each
from plateau.rendering.mapped import Task
from plateau.rendering.mapping import spec_for

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found]

_OF_OIDN: Final = ("albedo", "normal")
_MOST: Final = 10_000_000  #: values of a range
_SPACED: Final = {"from", "to", "count"}


class Recipe(Strict):
    """What a data set is to have."""

    #: Paths, seen from the recipe's folder, with ``*`` or without; or ``scenes:NAME``.
    scenes: tuple[str, ...] = Field(min_length=1)
    target: str | dict[str, Any] = "relmse"  #: the rule that ends each image
    inputs: tuple[int, ...] = ()  #: samples per pixel of noisy images that are kept too
    independent: bool = False  #: whether they are of other samples than the image
    aovs: tuple[str, ...] = ()
    variance: bool = False
    layout: Literal["exr", "oidn"] = "exr"  #: see `plateau.rendering.dataset.layouts`
    sensors: tuple[int, ...] = (0,)
    parameters: list[dict[str, Any]] | dict[str, Any] = Field(default_factory=dict)
    spec: dict[str, Any] = Field(default_factory=dict)  #: more fields of the jobs' spec
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
            return cls.model_validate({**found, "folder": path.absolute().parent})
        except ValidationError as error:
            located = [(one["loc"], one) for one in error.errors(include_url=False)]
            wrong = input_errors.by_field(located).items()
            words = "; ".join(": ".join(one) for one in wrong)
            raise CommandFailed(
                f"{path}: {words}. docs/datasets.md has the fields; those of a job are under [spec]"
            ) from None
        except ValueError as error:
            raise CommandFailed(f"{path} is no TOML: {error}") from None

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
        more = _OF_OIDN if self.layout == "oidn" else ()
        most = max(self.inputs, default=0)
        made = spec_for(
            self.target,
            self.inputs,
            independent=self.independent,
            aovs=tuple(dict.fromkeys((*self.aovs, *more))),
            variance=self.variance,
            fields=self.spec,
        )
        if not more or not most:
            return made
        # The image with the most samples is the target.
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

    def _scenes(self) -> Iterator[str]:
        for one in self.scenes:
            if one.startswith("scenes:"):
                yield one
            elif "*" not in one:
                yield str(self.folder / at_home(one))
            elif several := sorted(
                glob(str(at_home(one)), root_dir=self.folder, recursive=True)  # noqa: PTH207
            ):
                yield from (str(self.folder / path) for path in several)
            else:
                raise CommandFailed(f"there is no scene {one!r} in {self.folder}")

    def _entries(self) -> list[dict[str, Any]]:
        """The sets of parameters: those of a list, or every combination."""
        given = self.parameters
        if isinstance(given, list):
            return given
        values = [_values(name, one) for name, one in given.items()]
        return [dict(zip(given, one, strict=True)) for one in product(*values)]


def _values(name: str, given: Any) -> list[Any]:
    """The values of one parameter: one, a list, a range, or evenly spaced ones."""
    if isinstance(given, list):
        return given
    if isinstance(given, Mapping):
        if given.keys() != _SPACED or not isinstance(given["count"], int) or given["count"] < 1:
            raise CommandFailed(f"parameters: {name} must be like {{from = 0, to = 1, count = 5}}")
        first, last, count = given["from"], given["to"], given["count"]
        return [first + (last - first) * step / max(count - 1, 1) for step in range(count)]
    if isinstance(given, str) and ".." in given:
        return [one[name] for one in each([f"{name}={given}"], _MOST)]
    return [given]
