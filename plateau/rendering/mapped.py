"""One image of `plateau.map`: what is to be rendered, and what became of it."""

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from plateau.errors import CommandFailed
from plateau.farm.model.job import WatchedValue
from plateau.files.scene_at_hand import SceneAtHand
from plateau.rendering.result import Result

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Values: TypeAlias = Mapping[str, Any]
#: A scene, or what makes a Mitsuba dict of the parameters.
SceneOrMaker: TypeAlias = "SceneAtHand | Callable[..., Mapping[str, Any]]"

#: The layer of an input, with its samples per pixel and its channel.
_INPUT: Final = re.compile(r"spp(\d+)\.(.+)")


@dataclass(frozen=True, kw_only=True)
class Task:
    """One image to be rendered."""

    index: int  #: its place among all images, which decides its seed
    scene: SceneOrMaker
    parameters: Values = field(default_factory=dict)
    sensor: int = 0

    @property
    def scene_name(self) -> str:
        """What the scene is called: its path, the name of the callable, or ``dict``."""
        if callable(self.scene):
            return getattr(self.scene, "__name__", "callable")
        return "dict" if isinstance(self.scene, Mapping) else os.fspath(self.scene)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Mapped:
    """One image of `plateau.map`, or why there is none."""

    task: Task
    result: Result | None = None  #: the job's; None where there was none
    noisy: Result | None = None  #: that of the inputs, where they are independent
    failure: str = ""  #: why there is no image; "" where there is one

    @property
    def index(self) -> int:
        """Its place among all images, from 0."""
        return self.task.index

    @property
    def parameters(self) -> Values:
        """The parameters with which it was rendered."""
        return self.task.parameters

    @cached_property
    def image(self) -> "NDArray[np.float32]":
        """The image: (height, width, 3) float32, linear Rec. 709 radiance.

        Raises
        ------
        CommandFailed
            There is none; the message says why.
        """
        return self._rendered.image

    @cached_property
    def channels(self) -> "dict[str, NDArray[np.float32]]":
        """The image and its AOVs by channel, (height, width) float32, without the inputs."""
        layers = self._rendered.channels
        return {name: one for name, one in layers.items() if not _INPUT.fullmatch(name)}

    @cached_property
    def inputs(self) -> "dict[int, dict[str, NDArray[np.float32]]]":
        """By samples per pixel the noisy images, each by channel, (height, width) float32."""
        layers = (self.noisy or self._rendered).channels
        found: dict[int, dict[str, Any]] = {}
        for name, one in layers.items():
            if layer := _INPUT.fullmatch(name):
                found.setdefault(int(layer[1]), {})[layer[2]] = one
        return dict(sorted(found.items()))

    @cached_property
    def variance(self) -> "NDArray[np.float32] | None":
        """The variance of each value of the image, (height, width, 3) float32; None if not asked.

        It is without bias, and has three degrees of freedom: it is to be averaged over pixels.
        """
        import numpy as np

        planes = [self._rendered.channels.get(f"variance.{name}") for name in "RGB"]
        found = [one for one in planes if one is not None]
        return np.stack(found, axis=-1) if found else None

    @property
    def errors(self) -> dict[str, WatchedValue]:
        """By the name of each rule of the job: its value for this image, with its interval."""
        points = self.result.points if self.result else []
        return points[-1].rules if points else {}

    @property
    def non_finite(self) -> dict[str, int]:
        """By channel the pixels that are NaN or infinite, where there are any."""
        import numpy as np

        layers = self.result.channels if self.result and self.result.has_image else {}
        counts = {name: int(np.count_nonzero(~np.isfinite(one))) for name, one in layers.items()}
        return {name: count for name, count in counts.items() if count}

    @property
    def _rendered(self) -> Result:
        if self.failure or self.result is None:
            raise CommandFailed(f"image {self.index} ({self.task.scene_name}): {self.failure}")
        return self.result

    def __repr__(self) -> str:
        what = self.failure or repr(self.result)
        return f"<plateau.Mapped {self.index}: {what}>"
