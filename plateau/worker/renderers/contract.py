"""The contract for a renderer: the messages of a render child, and the class that it hosts.

A supervisor and its render child speak JSON lines over a socket that the child inherits. The
supervisor knows a renderer by these lines alone. Each request is one object, whose ``"do"`` names
its kind::

    {"do": "load", "id": 1, "folder": …, "entry": …, "parameters": {…}, "aovs": ["depth"]}
    {"do": "render", "id": 2, "passes": …, "glimpse": false, "zones": [], "inputs": []}
    {"do": "cancel", "id": 2}

and each answer is one object, whose ``"is"`` names its kind::

    {"is": "ready", "stays_open": […]}
    {"is": "loaded", "width": …, "height": …, "channels": ["R", "G", "B", "W", "Z"], "notes": […]}
    {"is": "working"}
    {"is": "glimpse", "at": …, "spp": …}
    {"is": "input", "at": …, "spp": …}
    {"is": "rendered", "at": …, "render_s": …, "notes": []}
    {"is": "cancelled"}
    {"is": "scene-error", "message": …}
    {"is": "disk-error", "message": …}
    {"is": "failed", "message": …}

The classes below say what each means. Pixels do not go through the socket: the child writes them
into a file that it inherits too. A film lies there as height × width × channels values in float32,
from the byte ``at`` on, until the next request to render. The film of zones has pixels × channels
values instead, as `Renderer.render` says. The end of the stream is the child's.

`plateau.worker.child` serves these requests for any class that fits `Renderer`. A renderer's
`plateau.farm.model.renderers.RendererFacts` name that class, and have all that others know of it.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, ClassVar, Final, Protocol, get_args, runtime_checkable

from plateau.farm.model.renderers import renderer_of, variant_named

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from plateau.farm.model.slices.zones import Zone
    from plateau.worker.renderers.canary import Canary

#: The channels with which every film begins, see `plateau.farm.images.channels`.
CHANNELS: Final = ("R", "G", "B", "W")


class SceneError(Exception):
    """The scene cannot be rendered, here or anywhere; the message is for who made the scene."""


class NotUnderstood(ValueError):
    """A line is no message of this contract."""


@dataclass(frozen=True, kw_only=True)
class Load:
    """Load a scene in the place of the one before; answered by `Loaded`.

    The slices of a job may differ in their AOVs. Where nothing else has changed, the scene of the
    request before may stay.

    Attributes
    ----------
    id : int
        The request's number, from 1.
    folder : str
        The scene's unpacked bundle; relative file names start here or beside `entry`.
    entry : str
        The scene's main file, relative to `folder`.
    parameters : mapping of str to str
        The job's values for the scene's parameters.
    sensor : int
        Index of the sensor to render.
    aovs : tuple of str
        What the film is to have besides colour, of `plateau.farm.model.aovs.AOVS`.
    threads : int
        How many load the scene, see `plateau.worker.supervisor.scene_cache.loading_threads`.
    """

    kind: ClassVar = "load"
    id: int = 0
    folder: str
    entry: str
    parameters: Mapping[str, str]
    sensor: int = 0
    aovs: tuple[str, ...] = ()
    threads: int = 1


@dataclass(frozen=True, kw_only=True)
class Render:
    """Render passes, each of so many spp with a seed; answered by `SumDone` or `Stopped`.

    With `glimpse`, a `FirstPass` comes before that where the other passes take a while. With
    `zones`, each an x, y, width and height, these parts of the film alone are rendered. Of whole
    films, an `InputDone` comes once the passes so far have so many spp as one of `inputs`.
    """

    kind: ClassVar = "render"
    id: int = 0
    passes: Sequence[tuple[int, int]]
    glimpse: bool = False
    zones: Sequence[Sequence[int]] = ()
    inputs: Sequence[int] = ()


@dataclass(frozen=True, kw_only=True)
class Cancel:
    """Stop a request to render at the end of its pass; one that comes too late is harmless."""

    kind: ClassVar = "cancel"
    id: int


@dataclass(frozen=True, kw_only=True)
class Ready:
    """The renderer is imported; sent once. `stays_open` says what does not confine the child."""

    kind: ClassVar = "ready"
    stays_open: Sequence[str]


@dataclass(frozen=True, kw_only=True)
class Loaded:
    """A scene is loaded.

    Attributes
    ----------
    width, height : int
        Pixels of the film (of its crop window, where it has one).
    notes : tuple of str
        What the renderer changed in the scene, a sentence each.
    channels : tuple of str
        The names of the film's channels, in the order of their values: R, G, B, W, then A where
        the scene's film has alpha, then the AOVs that were asked for, under the names of
        `plateau.farm.model.aovs.AOVS`, and those that the scene itself has.
    ids : tuple of str
        The channels that must not be averaged, such as the numbers of things. There, a film has the
        value of the pixel's first sample, and not a sum. Cryptomattes are known by their names.
    quotients : tuple of pairs of str
        Channels of light, each with that of the colour by which an image divides it.
    border : int
        How many pixels beyond its own a sample contributes to, to each side.
    look : str
        The scene's view transform, as `ViewTransform.as_text` has it; "" for none.
    header : mapping of str to str
        What the header of an image is to say: of its Cryptomattes (`plateau.farm.images.mattes`),
        and of the place of a crop in its film (`plateau.farm.images.crops`).
    """

    kind: ClassVar = "loaded"
    width: int
    height: int
    notes: tuple[str, ...] = ()
    channels: tuple[str, ...] = CHANNELS
    ids: tuple[str, ...] = ()
    quotients: Sequence[tuple[str, str]] = ()
    border: int = 0
    look: str = ""
    header: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Working:
    """Another part of a pass begins; without such answers the supervisor takes the child to hang.

    The parts of a pass take about a second.
    """

    kind: ClassVar = "working"


@dataclass(frozen=True, kw_only=True)
class FirstPass:
    """The film of the first pass, of `spp` samples per pixel, lies in the file from `at` on."""

    kind: ClassVar = "glimpse"
    at: int
    spp: int


@dataclass(frozen=True, kw_only=True)
class InputDone:
    """The sum of the passes so far, of `spp` samples per pixel, lies in the file from `at` on."""

    kind: ClassVar = "input"
    at: int
    spp: int


@dataclass(frozen=True, kw_only=True)
class SumDone:
    """The sum of the passes, added in their order in float64, lies in the file from `at` on."""

    kind: ClassVar = "rendered"
    at: int
    render_s: float
    notes: tuple[str, ...] = ()  #: on a film that is black


@dataclass(frozen=True, kw_only=True)
class Stopped:
    """The request to render was cancelled."""

    kind: ClassVar = "cancelled"


@dataclass(frozen=True, kw_only=True)
class SceneRefused:
    """The renderer refuses the scene, while it loads or while it renders, in its own words."""

    kind: ClassVar = "scene-error"
    message: str


@dataclass(frozen=True, kw_only=True)
class DiskFull:
    """This machine's disk takes no film. The scene has to be loaded again."""

    kind: ClassVar = "disk-error"
    message: str


@dataclass(frozen=True, kw_only=True)
class Failed:
    """The child ends, for a lack of memory or a fault that is not the scene's."""

    kind: ClassVar = "failed"
    message: str


Request = Load | Render | Cancel
Answer = (
    Ready | Loaded | Working | FirstPass | InputDone | SumDone | Stopped | SceneRefused | DiskFull
) | Failed

_REQUESTS: Final = {one.kind: one for one in (Load, Render, Cancel)}
_ANSWERS: Final = {one.kind: one for one in get_args(Answer)}


def request_line(request: Request) -> str:
    """Return a request as its line, the end of the line included."""
    return json.dumps({"do": request.kind, **vars(request)}) + "\n"


def answer_line(answer: Answer) -> str:
    """Return an answer as its line, the end of the line included."""
    return json.dumps({"is": answer.kind, **vars(answer)}) + "\n"


def read_request(line: str | bytes) -> Request:
    """Return the request that a line is; raise `NotUnderstood` where it is none."""
    request: Request = _read(line, "do", _REQUESTS)
    return request


def read_answer(line: str | bytes) -> Answer:
    """Return the answer that a line is; raise `NotUnderstood` where it is none."""
    answer: Answer = _read(line, "is", _ANSWERS)
    return answer


def _read(line: str | bytes, tag: str, kinds: Mapping[str, Any]) -> Any:
    try:
        fields = json.loads(line)
        kind = kinds[fields.pop(tag)]
        lists = {name: tuple(one) for name, one in fields.items() if isinstance(one, list)}
        return kind(**{**fields, **lists})
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise NotUnderstood(f"a line is no message of a render child: {line[:200]!r}") from error


class Renderer(Protocol):
    """A renderer in one of its variants, with at most one scene loaded.

    A pass is a pure function of the scene, the variant, its samples per pixel and its seed: every
    process of every machine has to give the same samples, however many threads it has.

    Parameters
    ----------
    variant : str
        The variant, by the name that the renderer itself gives it (``llvm_ad_rgb``).
    threads : int
        Threads that render, 1 or more.
    """

    def __init__(self, variant: str, threads: int) -> None: ...

    def probe(self) -> Canary:
        """Render a small image that is known, in a process that is there for this alone.

        It has to go the way of `load` and `render`, so that it shows what slices would be.

        Raises
        ------
        Exception
            Of whatever type: the variant does not work on this machine.
        """

    def load(self, request: Load) -> Loaded:
        """Load a scene in the place of the one before.

        Raises
        ------
        SceneError
            The scene is wrong, or asks for what the renderer cannot do; of an AOV that it does not
            know, the message names those that it has. No scene is loaded then.
        MemoryError
            This machine has too little memory: another try may go better.
        """

    def render(
        self,
        passes: Iterable[tuple[int, int]],
        *,
        zones: Sequence[Zone] = (),
        is_cancelled: Callable[[], bool],
    ) -> Iterator[NDArray[np.float32]]:
        """Yield the film of each pass, in order, before it is divided by its weights.

        Parameters
        ----------
        passes : iterable of (int, int)
            Of each the samples per pixel and the 32-bit seed, from a
            `plateau.farm.model.seeds.SeedSchedule`.
        zones : sequence of Zone
            The parts of the film to render, which do not overlap; none for the whole film. The
            samples of a pixel are the same whatever else is rendered.
        is_cancelled : callable
            Asked before each part of a pass, about once a second: the supervisor is told then that
            the renderer works. Once it says yes, no part begins any more.

        Yields
        ------
        ndarray, shape (height, width, channels), float32
            The sums of `Loaded.channels`, and the values of `Loaded.ids`. To be read, and not kept:
            the next pass may overwrite it.

        Raises
        ------
        SceneError
            The scene fails while it renders, or zones are asked of a renderer that has none.
        """


@runtime_checkable
class KnowsBlack(Protocol):
    """A renderer that has a note on a film in which no pixel has any light."""

    def why_black(self, zones: Sequence[Zone]) -> str:
        """Return why a film of the loaded scene, or of these zones, is black, as far as is known.

        Raises `SceneError` if it is one of the whole frame, and no other could be lighter.
        """


def check_aovs(asked: Iterable[str], known: Iterable[str]) -> None:
    """Raise `SceneError` where a job asks for an AOV that its renderer does not have."""
    has = tuple(known)
    for name in asked:
        if name not in has:
            raise SceneError(f"the renderer has no AOV {name!r}; it has {', '.join(has)}")


def renderer_for(variant: str, threads: int) -> Renderer:
    """Return the renderer of a variant of `plateau.farm.model.renderers`, imported here and now."""
    hosted = resolve_name(renderer_of(variant).child)
    renderer: Renderer = hosted(variant_named(variant).own_name, threads)
    return renderer
