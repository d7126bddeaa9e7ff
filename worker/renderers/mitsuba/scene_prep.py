"""Turns a scene file into the scene that the farm renders: parse, adapt, instantiate.

The farm needs three things that a scene may have otherwise, and changes them between Mitsuba's
parser and its plugins: the ``independent`` sampler (other samplers repeat their patterns from pass
to pass), a float32 RGB or RGBA ``hdrfilm`` (partials are added up), and an integrator whose samples
depend on nothing but the seed. What was changed is said in notes; the film's size, crop window and
reconstruction filter stay. Part of the render child: imports Mitsuba.
"""

from __future__ import annotations

import traceback
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import drjit as dr
import mitsuba as mi

from plateau.farm.bundle import BundleLimits
from plateau.farm.model.seeds import SCALAR_BLOCK
from plateau.worker.renderers.contract import SceneError, check_aovs
from plateau.worker.renderers.mitsuba.film_channels import MITSUBA_AOVS, film_channels

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from plateau.farm.model.aovs import AovName
    from plateau.worker.renderers.contract import Load
    from plateau.worker.renderers.mitsuba.film_channels import FilmChannels

#: The film's parameters that the farm sets, each with why.
_FILM = {
    "file_format": ("openexr", "results are OpenEXR and PNG files"),
    "component_format": ("float32", "the farm adds samples up in float32"),
}

#: Integrator parameters that would make a pass depend on time or split it behind our back.
_IMPURE = {
    "samples_per_pass": "the farm divides the samples into passes itself",
    "timeout": "the farm renders each pass to its end; a job has a time limit of its own",
}

#: Those of `mitsuba.ad`: they give an image and its derivatives, and no film that is not developed.
_DIFFERENTIABLE = (
    "the integrator '{}' is made for differentiable rendering, and its passes cannot be added up; "
    "use 'path' or 'volpath'"
)

_NO_WEIGHTS = (
    "the integrator '{}' does not sample pixel by pixel, and its passes cannot be added up; use "
    "'path' or 'volpath'"
)

#: What becomes of light in variants that do not render RGB.
_KINDS_OF_LIGHT = {
    "spectral": "spectra are rendered, and stored as linear RGB (Rec. 709)",
    "mono": "one channel of light is rendered, and stored as R, G and B alike",
    "polarized": "polarisation is rendered, and not stored",
}

#: The film's pixel formats with alpha.
_WITH_ALPHA = {"rgba", "luminance_alpha", "xyza"}

#: `scene_errors` itself and the function that uses it: Mitsuba's C++ has no frames of its own.
_OUR_FRAMES = 2

#: Names that Mitsuba's parser keeps for its own arguments.
_UNPASSABLE = {"config", "filename"}


@dataclass(frozen=True)
class PreparedScene:
    """A scene ready to render.

    Attributes
    ----------
    scene, sensor, film, integrator : Mitsuba objects
        The scene, the chosen sensor, its film and the scene's integrator.
    width, height : int
        Pixels of the film's crop window (the whole film where it has none).
    channels : FilmChannels
        What the film has.
    notes : tuple of str
        What was changed in the scene, a sentence each.
    """

    scene: Any
    sensor: Any
    film: Any
    integrator: Any
    width: int
    height: int
    channels: FilmChannels
    notes: tuple[str, ...]


def prepare(variant: str, request: Load) -> PreparedScene:
    """Return the scene that a request names, adapted to the farm and instantiated.

    Parameters
    ----------
    variant : str
        The Mitsuba variant in use.
    request : Load
        The scene, its parameters, and what its film is to have.

    Raises
    ------
    SceneError
        Mitsuba refuses the scene, or the farm cannot render it.
    """
    folder, entry, parameters = Path(request.folder), request.entry, request.parameters
    check_aovs(request.aovs, MITSUBA_AOVS)
    for name in _UNPASSABLE & parameters.keys():
        raise SceneError(
            f"a parameter cannot be named {name!r}, a name that Mitsuba keeps for itself; rename it"
        )
    # Not in the bundle's top folder too: seen from there, `..` would lead out of the bundle.
    _resolve_files_in((folder / entry).parent)
    config = mi.parser.ParserConfig(variant)
    # Else the order of shapes, and of lights among them, is another in each process, and with it
    # what a seed's random numbers stand for.
    config.parallel = config.merge_meshes = False
    _build_hierarchies_alone()
    with scene_errors(folder), _threads(request.threads):
        state = mi.parser.parse_file(config, str(folder / entry), **parameters)
        mi.parser.transform_all(config, state)
        notes = _adapt(variant, list(state.nodes))
        scene = mi.parser.instantiate(config, state)
    return _check(variant, scene, request, notes)


@contextmanager
def scene_errors(folder: Path | None = None) -> Iterator[None]:
    """Turn what Mitsuba raises into `SceneError`, save for a lack of memory, which passes.

    Whatever it is, the same scene would raise it again. Where Python code of Mitsuba's or of a
    plugin raises it, the traceback is printed for the slice's log, and the message is one line.

    Parameters
    ----------
    folder : Path, optional
        Where this machine keeps the scene; messages are told without it.
    """
    try:
        yield
    except SceneError:
        raise
    except Exception as error:
        message = str(error).strip() or type(error).__name__
        if isinstance(error, MemoryError) or "memory" in message.lower():
            raise MemoryError(message) from error
        if len(traceback.extract_tb(error.__traceback__)) > _OUR_FRAMES:
            traceback.print_exception(error)
            message = f"{type(error).__name__}: {message.splitlines()[0]}"
        for prefix in (folder, folder.resolve()) if folder else ():
            message = message.replace(f"{prefix}/", "")
        raise SceneError(message) from error


@cache
def _build_hierarchies_alone() -> None:
    """Have one thread build each scene's hierarchy of shapes, however many render.

    Where several do, it depends on who was first, and with it which of two triangles a ray hits
    that meets their edge: a matter of the last bits. Embree builds with as many threads as there
    are when a process makes its first scene; this is the first.
    """
    with _threads(1):
        mi.load_dict({"type": "scene", "shape": {"type": "sphere"}}, parallel=False)


@contextmanager
def _threads(count: int) -> Iterator[None]:
    """Have Mitsuba use so many threads."""
    before = dr.thread_count()
    dr.set_thread_count(count)
    try:
        yield
    finally:
        dr.set_thread_count(before)


def _resolve_files_in(*folders: Path) -> None:
    """Look files up in these folders and in Mitsuba's own data, and nowhere else."""
    core: Any = mi  # whose stubs know nothing of file resolvers
    resolver = core.FileResolver()
    for folder in dict.fromkeys((*folders, Path(mi.__file__).parent)):
        resolver.append(str(folder))
    core.set_file_resolver(resolver)


def _adapt(variant: str, nodes: list[Any]) -> tuple[str, ...]:
    """Edit the parsed scene in place; return what was changed, a sentence each, none twice."""
    kinds = {node.type for node in nodes}
    for kind, name in ((mi.ObjectType.Sensor, "sensor"), (mi.ObjectType.Integrator, "integrator")):
        # Mitsuba would invent one, and the person would get an image that they never described.
        if kind not in kinds:
            raise SceneError(f"the scene has no {name}; add a <{name}> to it")
    notes = [note for kind, note in _KINDS_OF_LIGHT.items() if kind in variant]
    for node in nodes:
        if node.props.plugin_name() == "moment":
            notes += _unwrap(node, nodes)
        if node.type == mi.ObjectType.Sampler:
            notes += _adapt_sampler(node)
        elif node.type == mi.ObjectType.Film:
            notes += _adapt_film(variant, node.props)
        elif node.type == mi.ObjectType.Integrator:
            notes += _adapt_integrator(variant, node.props)
    return tuple(dict.fromkeys(notes))


def _adapt_sampler(node: Any) -> Iterable[str]:
    was = node.props.plugin_name()
    had_seed = node.props.has_property("seed")
    count = node.props["sample_count"] if node.props.has_property("sample_count") else None
    # A new one: the old sampler's other parameters mean nothing to the independent sampler.
    properties = mi.Properties("independent")
    properties.set_id(node.props.id())
    node.props = properties
    if was != "independent":
        yield (
            f"the scene's '{was}' sampler was replaced by 'independent': others repeat their "
            "pattern from pass to pass"
        )
    if had_seed:
        yield "the sampler's seed was ignored: the job's seed is used"
    if count is not None:
        yield (
            f"the sampler's sample_count of {count} was ignored: the job's rule decides how many "
            "samples are rendered (the rule 'fixed' renders as many as you ask for)"
        )


def _adapt_film(variant: str, properties: Any) -> Iterable[str]:
    if properties.plugin_name() != "hdrfilm":
        raise SceneError(
            f"the scene's film is a '{properties.plugin_name()}', and the farm renders 'hdrfilm' "
            "only; change the film's type to that"
        )
    for name in ("width", "height", "crop_width", "crop_height"):
        # Said here: sensors divide by the film's size, and complain of their field of view.
        if properties.has_property(name) and not properties[name]:
            raise SceneError(f"the film's {name} is 0; make it 1 or more")
    asked = str(properties.get("pixel_format", "rgb"))
    has_alpha = asked.lower() in _WITH_ALPHA
    if "mono" in variant:
        properties["pixel_format"] = "luminance_alpha" if has_alpha else "luminance"
    else:
        properties["pixel_format"] = ours = "rgba" if has_alpha else "rgb"
        if asked.lower() != ours:
            yield (
                f"the film's pixel_format was changed from '{asked}' to '{ours}': results are RGB"
            )
    for name, (ours, why) in _FILM.items():
        theirs = properties[name] if properties.has_property(name) else ours
        if str(theirs).lower() != ours:
            yield f"the film's {name} was changed from '{theirs}' to '{ours}': {why}"
        properties[name] = ours
    if properties.has_property("compensate"):
        yield "the film's compensate was ignored: Mitsuba no longer has this setting"
    if properties.has_property("sample_border"):
        if properties["sample_border"]:
            yield "the film's sample_border was switched off: the farm samples the image alone"
        # It would enlarge the area that is sampled, and with it the seeds that a pass uses.
        properties["sample_border"] = False


def _unwrap(moment: Any, nodes: list[Any]) -> Iterable[str]:
    """Put the integrator inside a ``moment`` integrator in its place."""
    for name in moment.props.keys():  # noqa: SIM118  (no mapping: it cannot be iterated over)
        value = moment.props[name]
        if isinstance(value, mi.Properties.ResolvedReference):
            inner = nodes[value.index()]
            if inner.type == mi.ObjectType.Integrator:
                moment.props = inner.props
                yield (
                    "the 'moment' integrator was replaced by the integrator inside it: the farm "
                    "estimates the variance from its slices"
                )
                return


def _adapt_integrator(variant: str, properties: Any) -> Iterable[str]:
    if properties.plugin_name() == "ptracer":
        raise SceneError(_NO_WEIGHTS.format("ptracer"))
    for name, why in _IMPURE.items():
        if properties.has_property(name):
            properties.remove_property(name)
            yield f"the integrator's {name} was ignored: {why}"
    if variant.startswith("scalar"):
        # Left alone, Mitsuba shrinks the blocks of small films as threads are added, and a
        # block's place in the film decides its seed.
        if properties.has_property("block_size") and properties["block_size"] != SCALAR_BLOCK:
            yield (
                f"the integrator's block_size was changed from {properties['block_size']} to "
                f"{SCALAR_BLOCK}: the farm's seeds are made for blocks of that size"
            )
        properties["block_size"] = SCALAR_BLOCK


def _check(variant: str, scene: Any, request: Load, notes: tuple[str, ...]) -> PreparedScene:
    """Return the scene's parts, having refused what the farm cannot render."""
    if not isinstance(scene, mi.Scene):
        raise SceneError(
            "the file describes a part of a scene; its outermost element must be <scene>"
        )
    sensors = scene.sensors()
    if request.sensor >= len(sensors):
        raise SceneError(
            f"the scene has no sensor {request.sensor}; it has {len(sensors)}, and the first is "
            "sensor 0"
        )
    sensor = sensors[request.sensor]
    film = sensor.film()
    width, height = (int(size) for size in film.crop_size())
    if width * height > BundleLimits().max_pixels:
        raise SceneError(
            f"the film has {width}×{height} pixels, and the farm renders "
            f"{BundleLimits().max_pixels:,} at most; make the film smaller"
        )
    aovs = [name for name in MITSUBA_AOVS if name in request.aovs]
    integrator = _with_aovs(_checked(scene.integrator()), aovs)
    channels = film_channels(
        has_alpha=mi.has_flag(film.flags(), mi.FilmFlags.Alpha),
        integrator_names=integrator.aov_names(),
        asked=aovs,
    )
    if channels.ids and variant.startswith("scalar"):
        raise SceneError(
            f"the variant {variant} would average the numbers in the channel "
            f"{channels.ids[0]}; ask for an LLVM or CUDA variant, or leave this AOV out"
        )
    return PreparedScene(scene, sensor, film, integrator, width, height, channels, notes)


def _checked(integrator: Any) -> Any:
    if isinstance(integrator, mi.CppADIntegrator):
        raise SceneError(_DIFFERENTIABLE.format(type(integrator).__name__))
    if not isinstance(integrator, mi.SamplingIntegrator):
        raise SceneError(_NO_WEIGHTS.format(integrator.class_name()))
    return integrator


def _with_aovs(integrator: Any, asked: Sequence[AovName]) -> Any:
    """Return an integrator that gives these AOVs too, as the last ones."""
    if not asked:
        return integrator
    aovs = ",".join(f"{name}:{MITSUBA_AOVS[name]}" for name in asked)
    return mi.load_dict({"type": "aov", "aovs": aovs, "image": integrator})
