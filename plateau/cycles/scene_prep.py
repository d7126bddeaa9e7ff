"""Opens a Blender file, and prepares it for rendering stretches of samples.

Part of the render child: imports `bpy`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plateau.cycles.blender import blender, bpy
from plateau.cycles.view import baked, described
from plateau.farm.bundle import BundleLimits
from plateau.worker.renderers.contract import SceneError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from plateau.farm.images.view_transform import ViewTransform

#: The samples of a sequence, of which each pass renders some: the same for every job, since a
#: stretch of samples may depend on it.
_SAMPLES: Final = 2**20
_MOST_NAMES: Final = 20
_LEAST_THREADS: Final = 2
#: Images whose pixels are in a file.
_FROM_FILES: Final = ("FILE", "SEQUENCE", "MOVIE", "TILED")


@dataclass(frozen=True)
class PreparedScene:
    """A scene ready to render.

    Attributes
    ----------
    scene : bpy.types.Scene
        The scene.
    layer : bpy.types.ViewLayer
        The view layer that is rendered.
    width, height : int
        Pixels of the film.
    look : ViewTransform or None
        The scene's view transform; None where the image is seen as it is.
    notes : tuple of str
        What was changed in the scene, a sentence each.
    """

    scene: Any
    layer: Any
    width: int
    height: int
    look: ViewTransform | None
    notes: tuple[str, ...]

    @property
    def has_alpha(self) -> bool:
        """Whether the film is transparent where the world is seen."""
        return bool(self.scene.render.film_transparent)


def open_scene(file: Path, folder: Path) -> Any:
    """Return the scene of a Blender file in a bundle, opened with scripts and drivers off.

    Raises
    ------
    SceneError
        Blender cannot read the file, or files that it refers to are missing.
    """
    with blender():
        # No preference of this machine counts.
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bpy.context.preferences.filepaths.use_scripts_auto_execute = False
        bpy.ops.wm.open_mainfile(filepath=str(file), load_ui=False, use_scripts=False)
    missing = sorted({_shown(path, folder) for path in _files() if not path.is_file()})
    if missing:
        more = f" and {len(missing) - _MOST_NAMES} more" if len(missing) > _MOST_NAMES else ""
        raise SceneError(
            f"the scene refers to files that it was not sent with: "
            f"{', '.join(missing[:_MOST_NAMES])}{more}; pack them into it (File > External Data > "
            "Pack Resources), or send its folder, with relative paths"
        )
    return bpy.context.scene


def prepare(scene: Any, parameters: Mapping[str, str], threads: int) -> PreparedScene:
    """Return a scene with a job's parameters, and without what belongs to Plateau.

    Raises
    ------
    SceneError
        It has no camera, another engine, or too many pixels.
    """
    render = scene.render
    if render.engine != "CYCLES":
        raise SceneError(
            f"the scene's render engine is {render.engine}; set it to Cycles and save the file"
        )
    _set_parameters(scene, parameters)
    width = render.resolution_x * render.resolution_percentage // 100
    height = render.resolution_y * render.resolution_percentage // 100
    most = BundleLimits().max_pixels
    if not 0 < width * height <= most:
        raise SceneError(f"a film of {width}×{height} pixels: 1 to {most} are allowed")
    if scene.camera is None:
        raise SceneError("the scene has no camera; add one, or name one by the parameter camera")
    notes = [*_leave_to_plateau(scene), *_reduce_to_one_image(scene)]
    layer = _only_layer(scene, notes)
    # With one thread, a thread of Blender's TBB spins for ever (seen in Blender 5.0.1).
    render.threads_mode, render.threads = "FIXED", max(_LEAST_THREADS, threads)
    look = baked(scene)
    if look is not None:
        notes.append(
            f"The scene is seen through its view transform ({described(scene)}); image.exr is "
            "linear."
        )
    _write_films(render)
    return PreparedScene(scene, layer, width, height, look, tuple(notes))


def _set_parameters(scene: Any, parameters: Mapping[str, str]) -> None:
    render = scene.render
    if parameters.keys() & {"width", "height"}:
        render.resolution_x = int(
            parameters.get("width", render.resolution_x * render.resolution_percentage // 100)
        )
        render.resolution_y = int(
            parameters.get("height", render.resolution_y * render.resolution_percentage // 100)
        )
        render.resolution_percentage = 100
    if "camera" in parameters:
        named = scene.objects.get(parameters["camera"])
        if named is None or named.type != "CAMERA":
            known = sorted(one.name for one in scene.objects if one.type == "CAMERA")
            raise SceneError(
                f"the scene has no camera {parameters['camera']!r}; it has "
                f"{', '.join(known[:_MOST_NAMES]) or 'none'}"
            )
        scene.camera = named
        for marker in scene.timeline_markers:
            marker.camera = None  # else the frame's marker chooses another
    with blender():
        scene.frame_set(int(parameters.get("frame", scene.frame_current)))


def _leave_to_plateau(scene: Any) -> Iterator[str]:
    """Turn off what would make samples depend on each other, or stop them."""
    cycles, render = scene.cycles, scene.render
    off = {
        "use_adaptive_sampling": "adaptive sampling",
        "use_denoising": "denoising",
        "use_guiding": "path guiding",
        "time_limit": "the time limit",
    }
    was_on = [named for setting, named in off.items() if getattr(cycles, setting)]
    for setting in off:
        setattr(cycles, setting, 0 if setting == "time_limit" else False)
    if was_on:
        yield f"{', '.join(was_on).capitalize()} of Cycles: off. Plateau decides when to stop."
    if scene.render.use_compositing and scene.compositing_node_group is not None:
        yield "The compositor is off: the image is the render."
    render.use_compositing = render.use_sequencer = False
    if not cycles.volume_biased and _has_volumes(scene):
        yield "Volumes: sampled by steps (Biased). Cycles cannot repeat its unbiased samples."
    cycles.volume_biased = True
    if any(one.is_shadow_catcher for one in scene.objects):
        yield (
            "Cycles composes a shadow catcher's shadow in each slice by itself, so the mean of the "
            "slices is a little off where the shadow ends; a larger slice_spp helps."
        )
    cycles.sampling_pattern = "TABULATED_SOBOL"
    cycles.scrambling_distance, cycles.auto_scrambling_distance = 1.0, False
    cycles.use_animated_seed = False
    cycles.use_layer_samples = "IGNORE"
    cycles.samples, cycles.use_sample_subset = _SAMPLES, True
    render.use_persistent_data = True


def _has_volumes(scene: Any) -> bool:
    """Return whether anything in a scene, or its world, is a volume."""
    slots = (slot for one in scene.objects for slot in one.material_slots)
    shaders = (scene.world, *(slot.material for slot in slots))
    trees = (one.node_tree for one in shaders if one is not None and one.node_tree is not None)
    outputs = (node for tree in trees for node in tree.nodes if "Volume" in node.inputs)
    return any(one.type == "VOLUME" for one in scene.objects) or any(
        node.inputs["Volume"].is_linked for node in outputs
    )


def _reduce_to_one_image(scene: Any) -> Iterator[str]:
    render = scene.render
    others = {
        "use_border": "the render region",
        "use_multiview": "stereoscopy",
        "use_freestyle": "Freestyle",
    }
    had = [named for setting, named in others.items() if getattr(render, setting)]
    for setting in others:
        setattr(render, setting, False)
    if had:
        yield f"Left out: {', '.join(had)}."


def _only_layer(scene: Any, notes: list[str]) -> Any:
    layers = [one for one in scene.view_layers if one.use] or list(scene.view_layers)
    for other in scene.view_layers:
        other.use = other == layers[0]
    if len(layers) > 1:
        notes.append(f"Of {len(layers)} view layers the first is rendered: {layers[0].name}.")
    return layers[0]


def _write_films(render: Any) -> None:
    """Have a render written as it is: linear Rec. 709 in float32, a crop of its band."""
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x = 0.0, 1.0
    render.use_file_extension = render.use_stamp = False
    written = render.image_settings
    written.media_type = "MULTI_LAYER_IMAGE"
    written.file_format, written.exr_codec = "OPEN_EXR_MULTILAYER", "NONE"
    written.color_mode, written.color_depth = "RGBA", "32"
    written.color_management = "OVERRIDE"
    written.linear_colorspace_settings.name = "Linear Rec.709"


def _files() -> Iterator[Path]:
    """Yield the files to which the open one refers."""
    for kind in (bpy.data.libraries, bpy.data.fonts, bpy.data.volumes, bpy.data.cache_files):
        for one in kind:
            if not getattr(one, "packed_file", None) and one.filepath not in ("", "<builtin>"):
                yield _absolute(one.filepath, one)
    for image in bpy.data.images:
        if image.source in _FROM_FILES and not image.packed_files and image.users:
            numbers = [tile.number for tile in image.tiles] if image.source == "TILED" else [0]
            for number in numbers:
                yield _absolute(image.filepath.replace("<UDIM>", str(number)), image)


def _absolute(path: str, of: Any) -> Path:
    return Path(bpy.path.abspath(path, library=getattr(of, "library", None)))


def _shown(path: Path, folder: Path) -> str:
    """Return a path as the scene has it, without this machine's folders."""
    whole, here = Path(path.as_posix()), folder.resolve()
    for base in (folder, here):
        if whole.is_relative_to(base):
            return str(whole.relative_to(base))
    return str(whole)
