"""`plateau.map`: renders many scenes, or one with many parameters, and yields their images.

Jobs are submitted some at a time, so that a farm never waits and nothing piles up. What an image
is depends on its place among all of them, and not on which others are rendered beside it.
"""

import os
import secrets
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, islice
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from plateau.client import ApiError, Client
from plateau.client.submission import spec_of
from plateau.errors import CommandFailed, needs
from plateau.farm.bundle import BundleError
from plateau.farm.model.errors import InvalidSpec
from plateau.farm.model.job import WatchedValue
from plateau.farm.model.seeds import JOB_SEEDS
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.files.scene_at_hand import SceneAtHand
from plateau.processes.interrupts import Interrupts
from plateau.processes.read_settings import api_key, read_settings
from plateau.rendering.result import Result

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Values: TypeAlias = Mapping[str, Any]
#: A scene, or what makes a Mitsuba dict of the parameters.
SceneOrMaker: TypeAlias = "SceneAtHand | Callable[..., Mapping[str, Any]]"

_TICK_S: Final = 0.25
_EXR: Final = "image.exr"
#: Jobs in flight on a service, whose workers are not ours to count.
_ON_A_SERVICE: Final = 48
#: Samples per pixel of a slice where nothing is said, and slices between two evaluations.
_SLICE_SPP: Final = 64
_PARTS: Final = 4
_MOST_SLICE_SPP: Final = 4096
#: How far the seed of an independent input is from that of its reference: odd, as the number of
#: seeds is often a power of two.
_APART: Final = JOB_SEEDS // 2 + 1
#: Answers of a service that are the caller's fault, and no scene's.
_NOT_OF_A_SCENE: Final = frozenset({401, 403, 408, 409, 429})


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
        return {name: one for name, one in layers.items() if not name.startswith(_INPUT)}

    @cached_property
    def inputs(self) -> "dict[int, dict[str, NDArray[np.float32]]]":
        """By samples per pixel the noisy images, each by channel, (height, width) float32."""
        layers = (self.noisy or self._rendered).channels
        found: dict[int, dict[str, Any]] = {}
        for name, one in layers.items():
            if name.startswith(_INPUT):
                spp, _, channel = name.removeprefix(_INPUT).partition(".")
                found.setdefault(int(spp), {})[channel] = one
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


#: How the layers of inputs begin.
_INPUT: Final = "spp"


def map(  # noqa: A001  (as users call it)
    scenes: "SceneOrMaker | Iterable[SceneOrMaker]",
    parameters: Iterable[Values] = ({},),
    *,
    target: Any = "relmse",
    inputs: Sequence[int] = (),
    independent: bool = False,
    aovs: Sequence[str] = (),
    variance: bool = False,
    sensors: Sequence[int] = (0,),
    ordered: bool = False,
    farm: str | None = None,
    key: str | None = None,
    workers: int | None = None,
    threads: int | None = None,
    **fields: Any,
) -> Iterator[Mapped]:
    """Render each scene with each set of parameters, and yield the images as they are finished.

    Without `farm`, a farm runs on this machine until the generator ends or is closed. An image that
    fails is yielded with its `failure`, and the others go on.

    Parameters
    ----------
    scenes
        One or several: paths, ``scenes:NAME``, Mitsuba dicts; or a callable that makes a dict of a
        set of parameters, as keywords.
    parameters
        The sets of values of the scenes' ``$parameters``; a generator is read as it is needed.
    target
        The rule that ends each image, such as ``"relmse:target=0.001"``, ``"jod"``,
        ``"fixed:spp=64"`` or ``{"name": "psnr", "target": 45}``.
    inputs
        Samples per pixel, rising, of noisy images that are kept too: the first passes of the same
        slices, so each is a part of the next one and of the image.
    independent
        Take the inputs from other samples than the image, so that their noise says nothing of its.
    aovs
        What images and inputs have beside colour, such as ``("albedo", "normal")``.
    variance
        Whether to estimate the variance of each value of the image.
    sensors
        Indices of the sensors that render each.
    ordered
        Yield the images in their order: by scene, then parameters, then sensor.
    farm, key
        URL of a service that renders them, and its API key; by default a farm on this machine. Jobs
        are deleted from the service once they are fetched.
    workers, threads
        Of a farm on this machine; by default a worker for each GPU or else for each core, up to 8,
        and their share of the cores.
    **fields
        More fields of `JobSpec` for all: ``max_spp=4096``, ``seed=1``, ``watch=("jod",)``.

    Yields
    ------
    Mapped
        One for each image.

    Raises
    ------
    plateau.InvalidSpec
        A field is unknown, or its value is not allowed.
    plateau.errors.PlateauError
        The farm could not start, or refuses what is not of one scene.

    Examples
    --------
    >>> import plateau
    >>> angles = ({"x": 0.1 * step} for step in range(10))
    >>> for one in plateau.map("room.xml", angles, inputs=[1, 4]):  # doctest: +SKIP
    ...     train(one.inputs[4]["R"], one.channels["R"], one.errors["relmse"].value)
    """
    spec = spec_for(
        target, inputs, independent=independent, aovs=aovs, variance=variance, fields=fields
    )
    every: list[Any]
    if callable(scenes) or isinstance(scenes, str | os.PathLike | Mapping):
        every = [scenes]
    else:
        every = [*scenes]
    values = parameters if len(every) == 1 else [*parameters]
    combined = ((one, given, sensor) for one in every for given in values for sensor in sensors)
    tasks = (
        Task(index=index, scene=scene, parameters=given, sensor=sensor)
        for index, (scene, given, sensor) in enumerate(combined)
    )
    place = Place(farm=farm, key=key, workers=workers, threads=threads)
    return rendered(tasks, spec, place, independent=independent, ordered=ordered)


def spec_for(
    target: Any,
    inputs: Sequence[int],
    *,
    independent: bool,
    aovs: Sequence[str],
    variance: bool,
    fields: Mapping[str, Any],
) -> JobSpec:
    """The spec of all images: nothing is made but what is asked for, in slices of a good size.

    One slice is the cheapest; an error or a variance needs four.
    """
    given = {
        "rule": target,
        "aovs": tuple(aovs),
        "variance": variance,
        "inputs": tuple(inputs),
        "pictures": False,
        "watch": (),
        "allocation": "frame",
        "exr": {"compression": "none"},  # it hardly shrinks noise
        **fields,
    }
    spec = spec_of(None, {**given, "inputs": (), "slice_spp": 1})
    end = spec.rule.behaviour.soonest_end_spp(1) if spec.rule.name == "fixed" else None
    least = max(inputs, default=1)
    if end is not None:
        end = min(end, spec.max_spp) if "max_spp" in fields else end
        parts = max(-(-end // _MOST_SLICE_SPP), _PARTS if spec.by_quarters else 1)
        size = max(-(-end // parts), 1)
        sizes = {"slice_spp": size, "step": size * parts, "max_spp": end}
    else:
        size = max(_SLICE_SPP, least)
        sizes = {"slice_spp": size, "step": _PARTS * size}
    if independent and not inputs:
        raise InvalidSpec("independent: there are no inputs to be independent; name their spp")
    return spec_of(None, {**sizes, **given})


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where images are rendered."""

    farm: str | None = None  #: URL of a service; None for a farm on this machine
    key: str | None = None  #: its API key; None for that of the environment
    workers: int | None = None  #: on this machine
    threads: int | None = None  #: of each of them

    @contextmanager
    def opened(
        self, spec: JobSpec, interrupts: Interrupts, tell: Callable[[str], None]
    ) -> "Iterator[_Opened]":
        """The farm, for as long as the context lasts."""
        if self.farm is not None:
            key = self.key or api_key(read_settings())
            with Client(self.farm, key=key, once_heard_s=3600.0) as client:
                yield _Opened(client, lambda: None, _ON_A_SERVICE)
            return
        from plateau.rendering.own_farm import check_variant, own_farm, settings_here, workers_for

        settings = settings_here()
        check_variant(spec.variant, settings.cache)
        workers = self.workers or workers_for(spec.variant)
        with own_farm(
            settings, interrupts, spec, workers=workers, threads=self.threads, tell=tell
        ) as (tree, client):
            yield _Opened(client, tree.check, 4 * workers + 8)


@dataclass(frozen=True)
class _Opened:
    client: Client
    check: Callable[[], None]  #: to be called a few times a second
    window: int  #: the most images that are submitted and not yet taken


def rendered(
    tasks: Iterable[Task],
    spec: JobSpec,
    place: Place,
    *,
    independent: bool = False,
    ordered: bool = False,
    interrupts: Interrupts | None = None,
    tell: Callable[[str], None] = lambda _: None,
    tick: Callable[[], None] = lambda: None,
) -> Iterator[Mapped]:
    """Yield the image of each task; the tasks are read as they are needed.

    Parameters
    ----------
    tasks, spec, place
        What is rendered, how, and where.
    independent, ordered
        As for `map`.
    interrupts
        The first one ends the iteration; None leaves signals to others.
    tell
        Called with a line about each process that is started again.
    tick
        Called a few times a second, in this thread.
    """
    asked = interrupts or Interrupts()
    first = next(iter_tasks := iter(tasks), None)
    if first is None:
        return
    with place.opened(spec, asked, tell) as farm:
        run = _Run(farm.client, spec, farm.window, independent=independent)
        try:
            for one in run.results(chain([first], iter_tasks), ordered=ordered):
                if one is not None:
                    yield one
                if asked.asked.is_set():
                    return
                farm.check()
                tick()
        finally:
            run.close()


class _Run:
    """The images that are under way on a farm."""

    def __init__(self, client: Client, spec: JobSpec, window: int, *, independent: bool) -> None:
        self._client = client
        self._window, self._chunk = window, max(1, window // 3)
        self._name = f"map-{secrets.token_hex(4)}"
        self._batches = 0
        self._lock = threading.Lock()
        self._open: dict[str, set[str]] = {}  # by batch, its jobs that were not fetched
        self._has_values = spec.rule.name != "fixed" or bool(spec.watch)
        self._known: dict[str, str] = {}  # the SHA-256 of scenes that are stored, by their paths
        self._pool = ThreadPoolExecutor(window + 1, thread_name_prefix="map")
        self._specs = [spec]
        if independent:
            fixed = {"name": "fixed", "spp": spec.inputs[-1]}
            alone = {"watch": (), "variance": False, "min_spp": None, "step": spec.slice_spp}
            self._specs = [
                spec_of(spec, {"inputs": ()}),
                spec_of(spec, {"rule": fixed, **alone}),
            ]

    def results(self, tasks: Iterator[Task], *, ordered: bool) -> Iterator[Mapped | None]:
        """Yield each image, and None a few times a second while there is none."""
        submissions: set[Future[list[tuple[Task, Any]]]] = set()
        fetches: set[Future[Mapped]] = set()
        ready: dict[int, Mapped] = {}
        following: list[int] = []  # in their order, those that were not yielded
        waiting: list[Task] = []
        while True:
            # One submission at a time keeps jobs in the order of their tasks.
            room = self._window - len(following)
            if not submissions and room >= self._chunk:
                waiting += islice(tasks, self._chunk - len(waiting))
                if alike := _alike(waiting):
                    del waiting[: len(alike)]
                    following += [one.index for one in alike]
                    submissions.add(self._pool.submit(self._submit, alike))
            if not following:
                return
            under_way: set[Future[Any]] = {*submissions, *fetches}
            now = wait(under_way, _TICK_S, FIRST_COMPLETED).done
            for made in submissions & now:
                submissions.discard(made)
                for task, jobs in made.result():
                    if isinstance(jobs, str):
                        ready[task.index] = Mapped(task=task, failure=jobs)
                    else:
                        fetches.add(self._pool.submit(self._fetch, task, jobs))
            for done in fetches & now:
                fetches.discard(done)
                ready[done.result().index] = done.result()
            yield None
            while following and (ready if not ordered else following[0] in ready):
                index = following[0] if ordered else next(iter(ready))
                following.remove(index)
                yield ready.pop(index)

    def close(self) -> None:
        """Cancel what is under way; nobody waits for it any more."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        for batch in [name for name, jobs in self._open.items() if jobs]:
            with suppress(Exception):
                self._client.cancel_batch(batch)

    def _submit(self, tasks: Sequence[Task]) -> list[tuple[Task, Any]]:
        """Submit alike tasks; returns for each the ids of its jobs, or why there is none."""
        try:
            made = [self._jobs(tasks, spec, far * _APART) for far, spec in enumerate(self._specs)]
        except (BundleError, InvalidSpec, ApiError, _MakerFailed) as error:
            if isinstance(error, ApiError) and (
                error.status >= 500 or error.status in _NOT_OF_A_SCENE
            ):
                raise
            if len(tasks) == 1:
                return [(tasks[0], str(error))]
            middle = len(tasks) // 2  # the others are not to blame
            return self._submit(tasks[:middle]) + self._submit(tasks[middle:])
        return list(zip(tasks, zip(*made, strict=True), strict=True))

    def _jobs(self, tasks: Sequence[Task], spec: JobSpec, apart: int) -> list[str]:
        """The ids of the jobs of alike tasks, in their order."""
        first = tasks[0]
        self._batches += 1
        name = f"{self._name}-{self._batches}"
        shared = spec.model_copy(update={"batch": name, "sensor": first.sensor})
        scene, values = first.scene, [dict(one.parameters) for one in tasks]
        if callable(scene):
            scene, values = _made(scene, first), [{}]
        path = scene if isinstance(scene, Mapping) else os.fspath(scene)
        stored = None if isinstance(path, Mapping) else self._known.get(path)
        frame = (first.index + apart) % JOB_SEEDS
        try:
            self._client.submit_batch(stored or path, values, shared, first_frame=frame)
        except ApiError as error:
            if stored is None or error.status in _NOT_OF_A_SCENE:
                raise
            # Parameters may name files that the stored bundle lacks.
            self._client.submit_batch(path, values, shared, first_frame=frame)
        jobs = list(self._client.all_jobs(batch=name))
        if not isinstance(path, Mapping):
            self._known[path] = jobs[0].scene_sha256
        with self._lock:
            self._open[name] = {job.id for job in jobs}
        by_frame = {(job.spec.frame_seed - frame) % JOB_SEEDS: job.id for job in jobs}
        return [by_frame[place] for place in range(len(tasks))]

    def _fetch(self, task: Task, jobs: Sequence[str]) -> Mapped:
        """Wait for the jobs of a task, and fetch them."""
        results = [self._fetched(job_id) for job_id in jobs]
        failed = next((one for one in results if not one.has_image), None)
        found = Mapped(task=task, result=results[0], noisy=(*results, None)[1])
        if failed is not None:
            return replace(found, failure=failed.reason)
        if results[0].state is JobState.FAILED:
            return replace(found, failure=results[0].reason)
        if found.noisy is not None and _overlap(results[0], found.noisy):
            why = "its variant has too few seeds for inputs that are independent of the image"
            return replace(found, failure=why)
        return found

    def _fetched(self, job_id: str) -> Result:
        job = self._client.wait(job_id)
        result = Result.fetched(self._client, job, (_EXR,), with_curve=self._has_values)
        batch = job.spec.batch or ""
        with self._lock:
            jobs = self._open.get(batch, {job_id})
            jobs.discard(job_id)
        if not jobs:
            with suppress(ApiError):  # such as a key that may not delete
                self._client.delete_batch(batch)
        return result


class _MakerFailed(Exception):
    """A user's callable made no scene; the message says why."""


def _made(maker: Callable[..., Mapping[str, Any]], task: Task) -> Mapping[str, Any]:
    try:
        made = maker(**task.parameters)
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        raise _MakerFailed(f"{task.scene_name} raised {what}") from error
    if not isinstance(made, Mapping):
        raise _MakerFailed(
            f"{task.scene_name} made a {type(made).__name__}: a callable makes a Mitsuba dict"
        )
    return made


def _alike(tasks: Sequence[Task]) -> list[Task]:
    """The first tasks that can be submitted together: neighbours of one scene and sensor."""
    alike: list[Task] = []
    for one in tasks:
        if alike:
            first, last = alike[0], alike[-1]
            is_single = callable(one.scene) or isinstance(one.scene, Mapping)
            if is_single or one.scene != first.scene or one.sensor != first.sensor:
                break
            if one.index != last.index + 1:
                break
        alike.append(one)
    return alike


def _overlap(image: Result, inputs: Result) -> bool:
    """Whether two images have samples in common."""
    with needs("images"):
        from plateau.farm.images.exr import decode_header

    ranges = []
    for one in (image, inputs):
        header = decode_header(one.files[_EXR])
        ranges.append([int(header[f"plateau:{end}_seed"]) for end in ("first", "last")])
    (first, last), (other_first, other_last) = ranges
    return first <= other_last and other_first <= last
