"""Turns a scene file into the scene that the farm renders: parse, adapt, instantiate.

Part of the render child: imports Mitsuba.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Final

import drjit as dr
import mitsuba as mi

from plateau.farm.bundle import BundleLimits
from plateau.farm.images.crops import crop_header
from plateau.farm.model.aovs import AovName
from plateau.farm.model.seeds import SCALAR_BLOCK
from plateau.worker.renderers.causes import first_words, warnings_in, without_folders
from plateau.worker.renderers.contract import Load, SceneError, check_aovs
from plateau.worker.renderers.mitsuba.adaptation import NO_WEIGHTS, adapt
from plateau.worker.renderers.mitsuba.film_channels import MITSUBA_AOVS, FilmChannels, film_channels
from plateau.worker.renderers.mitsuba.mitsuba_words import explained, mitsuba_log, scene_errors

#: Those of `mitsuba.ad`: they give an image and its derivatives, and no film that is not developed.
_DIFFERENTIABLE = (
    "the integrator '{}' is made for differentiable rendering, and its passes cannot be added up; "
    "use 'path' or 'volpath'"
)

_MOST_WARNINGS: Final = 5

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
    header : mapping of str to str
        The place of a crop window in the film; empty where it has none.
    nodes : sequence of Mitsuba objects
        The scene as it was parsed, before it was adapted.
    """

    scene: Any
    sensor: Any
    film: Any
    integrator: Any
    width: int
    height: int
    channels: FilmChannels
    notes: tuple[str, ...]
    header: Mapping[str, str]
    nodes: Sequence[Any] = ()


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
    folder = Path(request.folder)
    check_aovs(request.aovs, MITSUBA_AOVS)
    for name in _UNPASSABLE & request.parameters.keys():
        raise SceneError(
            f"a parameter cannot be named {name!r}, a name that Mitsuba keeps for itself; rename it"
        )
    # Not in the bundle's top folder too: seen from there, `..` would lead out of the bundle.
    _resolve_files_in((folder / request.entry).parent)
    _build_hierarchies_alone()
    with mitsuba_log() as said, scene_errors(folder), _threads(request.threads):
        config, state = _parsed(variant, request)
        nodes = state.nodes
        try:
            mi.parser.transform_all(config, state)
            nodes = parsed_nodes(variant, request)  # Mitsuba uses up those that it instantiates
            for index, node in enumerate(state.nodes):
                if node.type in (mi.ObjectType.Sensor, mi.ObjectType.BSDF, mi.ObjectType.Emitter):
                    node.props.set_id(id_of(index, node))
            notes = adapt(variant, list(state.nodes))
            scene = mi.parser.instantiate(config, state)
        except RuntimeError as error:
            raise RuntimeError(explained(str(error), state, nodes)) from error
        warned = warnings_in(without_folders(said(), [folder]))[:_MOST_WARNINGS]
    notes = (*notes, *(f"Mitsuba warns: {first_words(one)}" for one in warned))
    return replace(_check(variant, scene, request, notes), nodes=nodes)


def _parsed(variant: str, request: Load) -> tuple[Any, Any]:
    """Return how a scene is parsed, and what that gives."""
    config = mi.parser.ParserConfig(variant)
    # Else the order of shapes, and of lights among them, is another in each process, and with it
    # what a seed's random numbers stand for.
    config.parallel = config.merge_meshes = False
    file = str(Path(request.folder) / request.entry)
    return config, mi.parser.parse_file(config, file, **request.parameters)


def parsed_nodes(variant: str, request: Load) -> Any:
    """Return the nodes of a parsed scene, in their order; raises what Mitsuba raises."""
    config, state = _parsed(variant, request)
    mi.parser.transform_all(config, state)
    return state.nodes


def id_of(index: int, node: Any) -> str:
    """Return the id by which the object of a parsed node is found in the scene."""
    return node.props.id() or f"node {index}"


def with_aovs(variant: str, one: PreparedScene, request: Load) -> PreparedScene:
    """Return a scene that is prepared, with the AOVs of another request; raises as `prepare`."""
    check_aovs(request.aovs, MITSUBA_AOVS)
    return _check(variant, one.scene, request, one.notes)


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
    width, height = _pair(film.crop_size())
    if width * height > BundleLimits().max_pixels:
        raise SceneError(
            f"the film has {width}×{height} pixels, and the farm renders "
            f"{BundleLimits().max_pixels:,} at most; make the film smaller"
        )
    aovs = [name for name in MITSUBA_AOVS if name in request.aovs]
    integrator = _with_aovs(variant, _checked(scene.integrator()), aovs)
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
    whole = _pair(film.size())
    header = {} if (width, height) == whole else crop_header(_pair(film.crop_offset()), whole)
    return PreparedScene(scene, sensor, film, integrator, width, height, channels, notes, header)


def _pair(of_film: Any) -> tuple[int, int]:
    x, y = map(int, of_film)
    return x, y


def _checked(integrator: Any) -> Any:
    if isinstance(integrator, mi.CppADIntegrator):
        raise SceneError(_DIFFERENTIABLE.format(type(integrator).__name__))
    if not isinstance(integrator, mi.SamplingIntegrator):
        raise SceneError(NO_WEIGHTS.format(integrator.class_name()))
    return integrator


def _with_aovs(variant: str, integrator: Any, asked: Sequence[AovName]) -> Any:
    """Return an integrator that gives these AOVs too, as the last ones, and the same samples."""
    if not asked:
        return integrator
    aovs = ",".join(f"{name}:{MITSUBA_AOVS[name]}" for name in asked)
    ours = {"block_size": SCALAR_BLOCK} if variant.startswith("scalar") else {}
    return mi.load_dict({"type": "aov", "aovs": aovs, "image": integrator, **ours})
