"""The passes of a Blender view layer, as channels of a film.

Cycles gives the passes of a stretch of samples in one of four ways, as was measured:

- **Means** over the samples: they are added up as colour is.
- **The first sample's**: depth, position and the numbers of objects and materials. Cycles writes
  them for the first sample of a sequence alone. The first slice of a job has it, and a film's ids
  keep the values of the first slice, so these are ids.
- **Quotients**: direct and indirect light is divided by the colour of the surface. Quotients do not
  add up, so a film has the light itself, and `plateau.farm.images.channels` divides the sums.
- **Cryptomattes**: ids and the shares of the samples that have met them. A film has the samples.

Part of the render child.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plateau.farm.images.mattes import attributes_of, letter_of
from plateau.farm.model.aovs import AOVS, GUIDES
from plateau.worker.renderers.contract import check_aovs

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

    from numpy.typing import NDArray

    from plateau.farm.model.aovs import AovName

#: The AOVs of a job's spec that Cycles has.
CYCLES_AOVS: Final[tuple[AovName, ...]] = (
    *("albedo", "normal", "depth", "position", "uv", "shape_id"),
)
_COLOUR: Final = "Combined"
#: Colour as it was before Cycles' denoiser, which is off.
_COLOUR_AGAIN: Final = "Noisy Image"
_OF_FIRST_SAMPLE: Final = ("Depth", "Position", "Object Index", "Material Index")
_AOVS_OF_FIRST_SAMPLE: Final[tuple[AovName, ...]] = ("depth", "position", "shape_id")
_MEANS: Final = (
    *("Diffuse Color", "Glossy Color", "Transmission Color", "Emission", "Environment"),
    *("Diffuse Direct", "Diffuse Indirect", "Glossy Direct", "Glossy Indirect"),
    *("Transmission Direct", "Transmission Indirect", "Volume Direct", "Volume Indirect"),
    *("Ambient Occlusion", "Normal", "UV", "Mist", "Vector"),
    *("Denoising Albedo", "Denoising Normal", "Denoising Depth"),
)
_OF_A_DENOISER: Final = ("Denoising Albedo", "Denoising Normal", "Denoising Depth")
#: Passes that are no means over samples, by the setting of Cycles' that asks for them.
_LEFT_OUT: Final = {
    "use_pass_shadow_catcher": "Shadow Catcher",
    "use_pass_volume_scatter": "Volume Scatter",
    "use_pass_volume_transmit": "Volume Transmit",
    "use_pass_volume_majorant": "Volume Majorant",
    "pass_debug_sample_count": "Sample Count",
    "pass_render_time": "Render Time",
}
#: The passes from which an AOV is made, and the settings that ask for them.
_MADE_FROM: Final[Mapping[AovName, tuple[tuple[str, str], ...]]] = {
    "depth": (("use_pass_position", "Position"), ("use_pass_z", "Depth")),
    "position": (("use_pass_position", "Position"),),
    "uv": (("use_pass_uv", "UV"),),
    "shape_id": (("use_pass_object_index", "Object Index"),),
}
#: Light that Cycles divides by a colour.
_DIVIDED: Final = re.compile(r"(.*\.(?:Diffuse|Glossy|Transmission)) (?:Direct|Indirect)(\.[RGB])")
#: Beyond it Cycles has met nothing.
_NOTHING: Final = 1e9
_OBJECT_TYPES_WITHOUT_SURFACE: Final = ("CAMERA", "LIGHT", "EMPTY", "ARMATURE", "LIGHT_PROBE")


@dataclass(frozen=True)
class Passes:
    """The channels of a film besides R, G, B, W and A.

    Attributes
    ----------
    layer : str
        The name of the view layer, with which Blender begins a channel's name.
    asked : tuple of str
        The AOVs that the job asks for, in the order of their channels.
    camera : ndarray, shape (4, 4)
        The camera's matrix to the world.
    is_parallel : bool
        Whether the camera has no perspective.
    helpers : frozenset of str
        Passes that the view layer does not ask for, and that are rendered for `asked` alone.
    groups : frozenset of str
        What the view layer calls its own AOVs and its light groups, as names of passes.
    own : tuple of str
        The channels of the view layer, as Blender has written them.
    """

    layer: str
    asked: tuple[AovName, ...]
    camera: NDArray[np.float64]
    is_parallel: bool
    helpers: frozenset[str]
    groups: frozenset[str]
    own: tuple[str, ...] = ()

    def among(self, written: Iterable[str]) -> tuple[Passes, tuple[str, ...]]:
        """Return the passes with those of what Blender has written, and what is left out of them.

        A pass that is not known here is left out, for its mean may be wrong.
        """
        known = {*_MEANS, *_OF_FIRST_SAMPLE, *self.groups}
        own, unknown = [], dict[str, None]()
        for channel in written:
            name = self._pass_of(channel)
            if name in known - self.helpers or letter_of(channel):
                own.append(channel)
            elif name not in {_COLOUR, _COLOUR_AGAIN, *self.helpers}:
                unknown[name] = None
        return replace(self, own=tuple(own)), tuple(unknown)

    @property
    def names(self) -> tuple[str, ...]:
        """The channels by their names in a film."""
        asked = (channel for name in self.asked for channel in AOVS[name].channels)
        return (*asked, *map(stored_name, self.own))

    @property
    def ids(self) -> tuple[str, ...]:
        """The channels that have the value of a pixel's first sample."""
        asked = (
            channel
            for name in self.asked
            if name in _AOVS_OF_FIRST_SAMPLE
            for channel in AOVS[name].channels
        )
        return (*asked, *map(stored_name, filter(self._is_of_first_sample, self.own)))

    @property
    def quotients(self) -> tuple[tuple[str, str], ...]:
        """The channels of light, each with that of the colour by which an image divides it."""
        divided = self._divided.items()
        return tuple((stored_name(light), stored_name(colour)) for light, colour in divided)

    def planes(
        self, found: Mapping[str, NDArray[np.float32]], spp: int
    ) -> Iterator[NDArray[np.float32]]:
        """Yield the values of each channel: sums of `spp` samples, and ids.

        Parameters
        ----------
        found : mapping of str to ndarray, shape (height, width)
            What Blender has written of a pass, by channel.
        spp : int
            Samples per pixel of the pass.
        """
        for name in self.asked:
            values = self._made(name, found)
            yield from values if name in _AOVS_OF_FIRST_SAMPLE else values * spp
        divided = self._divided
        for channel in self.own:
            if self._is_of_first_sample(channel) or letter_of(channel) in {"r", "b"}:
                yield found[channel]
            elif channel in divided:
                yield found[channel] * found[divided[channel]] * spp
            else:
                yield found[channel] * spp

    def _made(self, name: AovName, found: Mapping[str, NDArray[np.float32]]) -> NDArray[np.float32]:
        """Return an AOV of the job's, (channels, height, width)."""

        def layers(of: str, letters: str) -> NDArray[np.float32]:
            return np.stack([found[f"{self.layer}.{of}.{letter}"] for letter in letters])

        if name == "albedo":
            return layers("Denoising Albedo", "RGB")
        if name == "normal":
            # Cycles has them in the camera's frame, which looks along its third axis.
            to_world = _rotation(self.camera) @ np.diag([1.0, 1.0, -1.0])
            normals = np.einsum("ij,jyx->iyx", to_world, layers("Denoising Normal", "XYZ"))
            return np.asarray(normals, np.float32)
        if name == "position":
            return layers("Position", "XYZ")
        if name == "uv":
            return layers("UV", "UV")
        if name == "shape_id":
            return layers("Object Index", "X")
        along = layers("Depth", "Z")
        offset = layers("Position", "XYZ") - self.camera[:3, 3].reshape(3, 1, 1)
        distance = along if self.is_parallel else np.linalg.norm(offset, axis=0, keepdims=True)
        return np.where(along < _NOTHING, distance, 0).astype(np.float32)

    @property
    def _divided(self) -> dict[str, str]:
        lights = ((channel, _DIVIDED.fullmatch(channel)) for channel in self.own)
        return {light: f"{found[1]} Color{found[2]}" for light, found in lights if found}

    def _pass_of(self, channel: str) -> str:
        return channel.removeprefix(f"{self.layer}.").rpartition(".")[0]

    def _is_of_first_sample(self, channel: str) -> bool:
        return self._pass_of(channel) in _OF_FIRST_SAMPLE


def ask_for(scene: Any, layer: Any, aovs: Collection[str]) -> tuple[Passes, list[str]]:
    """Have a view layer rendered with the passes of a film, and return them, with what is noted.

    Raises
    ------
    SceneError
        The job asks for an AOV that Cycles does not have.
    """
    check_aovs(aovs, CYCLES_AOVS)
    asked = tuple(name for name in CYCLES_AOVS if name in aovs)
    notes = _leave_out(layer)
    helpers = _helpers(layer, asked)
    layer.use_pass_combined = True  # the image itself
    if "shape_id" in asked and _number_objects(scene):
        notes.append("shape_id: objects have numbers in the order of their names, from 1.")
    _divisible(layer)
    passes = Passes(
        layer=layer.name,
        asked=asked,
        camera=np.array(scene.camera.matrix_world),
        is_parallel=scene.camera.data.type == "ORTHO",
        helpers=frozenset(helpers),
        groups=frozenset(
            [one.name for one in layer.aovs]
            + [f"{_COLOUR}_{one.name}" for one in layer.lightgroups]
        ),
    )
    return passes, notes


def left_out(names: Iterable[str]) -> str:
    """Return a note on passes that a film does not have."""
    return f"Passes left out, for the mean of slices is not the whole's: {', '.join(names)}."


def stored_name(channel: str) -> str:
    """Return a channel's name as a film can have it.

    Examples
    --------
    >>> stored_name("Küche.Depth.Z")
    'K_che.Depth.Z'
    """
    return "".join(one if one.isascii() and one.isprintable() else "_" for one in channel)


def matte_attributes(header: Mapping[str, Any]) -> dict[str, str]:
    """Return what a file of Blender's says of its Cryptomattes, by the names that a film has."""
    return {
        name: stored_name(value) if name.endswith("/name") else value
        for name, value in attributes_of(header).items()
    }


def _leave_out(layer: Any) -> list[str]:
    had = {setting: name for setting, name in _LEFT_OUT.items() if getattr(layer.cycles, setting)}
    for setting in had:
        setattr(layer.cycles, setting, False)
    return [left_out(had.values())] if had else []


def _helpers(layer: Any, asked: Collection[AovName]) -> set[str]:
    """Turn on the passes of which AOVs are made, and return those that were off."""
    helpers = set[str]()
    for name in asked:
        for setting, named in _MADE_FROM.get(name, ()):
            if not getattr(layer, setting):
                helpers.add(named)
                setattr(layer, setting, True)
    if not layer.cycles.denoising_store_passes:
        helpers.update(_OF_A_DENOISER)
        layer.cycles.denoising_store_passes = any(name in GUIDES for name in asked)
    return helpers


def _divisible(layer: Any) -> None:
    """Have the colour of a surface rendered wherever light is divided by it."""
    for kind in ("diffuse", "glossy", "transmission"):
        lights = (f"use_pass_{kind}_direct", f"use_pass_{kind}_indirect")
        if any(getattr(layer, one) for one in lights):
            setattr(layer, f"use_pass_{kind}_color", True)


def _number_objects(scene: Any) -> bool:
    """Give the objects numbers, unless the artist has given some."""
    objects = [one for one in scene.objects if one.type not in _OBJECT_TYPES_WITHOUT_SURFACE]
    if any(one.pass_index for one in objects):
        return False
    for number, one in enumerate(sorted(objects, key=lambda one: str(one.name_full)), start=1):
        one.pass_index = number
    return True


def _rotation(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    axes = matrix[:3, :3]
    rotation: NDArray[np.float64] = axes / np.linalg.norm(axes, axis=0)
    return rotation
