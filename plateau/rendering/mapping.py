"""`plateau.map`: renders many scenes, or one with many parameters, and yields their images.

Jobs are submitted some at a time, so that a farm never waits and nothing piles up. What an image
is depends on its place among all of them, and not on which others are rendered beside it.
"""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import chain
from typing import Any, Final

from plateau.client import Client
from plateau.client.submission import spec_of
from plateau.farm.model.errors import InvalidSpec
from plateau.farm.model.spec import JobSpec
from plateau.processes.interrupts import Interrupts
from plateau.processes.read_settings import api_key, read_settings
from plateau.rendering.mapped import Mapped, SceneOrMaker, Task, Values
from plateau.rendering.mapped_jobs import MappedJobs, OpenFarm

#: Jobs in flight on a service, whose workers are not ours to count.
_ON_A_SERVICE: Final = 48
_MOST_IN_FLIGHT: Final = 500  #: each has an open file, of which a process often may have 1,024
#: Samples per pixel of a slice where nothing is said, and slices between two evaluations.
_SLICE_SPP: Final = 64
_PARTS: Final = 4
_MOST_SLICE_SPP: Final = 4096


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
    on: str | None = None,
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
    on
        As for `plateau.render`: a cluster whose nodes have the workers.
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
    sets = [parameters] if isinstance(parameters, Mapping) else parameters
    values = sets if len(every) == 1 else [*sets]
    combined = ((one, given, sensor) for one in every for given in values for sensor in sensors)
    tasks = (
        Task(index=index, scene=scene, parameters=given, sensor=sensor)
        for index, (scene, given, sensor) in enumerate(combined)
    )
    place = Place(farm=farm, key=key, workers=workers, threads=threads, on=on)
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
    workers: int | None = None  #: on this machine, or an engine's
    threads: int | None = None  #: of each of them
    on: str | None = None  #: the engine that brings the workers; None for this machine

    @contextmanager
    def opened(
        self, spec: JobSpec, interrupts: Interrupts, tell: Callable[[str], None]
    ) -> Iterator[OpenFarm]:
        """The farm, for as long as the context lasts."""
        if self.farm is not None:
            key = self.key or api_key(read_settings())
            with Client(self.farm, key=key, once_heard_s=3600.0) as client:
                yield OpenFarm(client, lambda: None, lambda: None, lambda _: None, _ON_A_SERVICE)
            return
        from plateau.rendering.own_farm import check_variant, own_farm, settings_here, workers_for

        settings = settings_here(self.on)
        can = lru_cache(partial(check_variant, cache=settings.cache, on=self.on))
        can(spec.variant)
        workers = self.workers or (workers_for(spec.variant) if self.on is None else 1)
        with own_farm(
            settings, interrupts, spec, workers=workers, threads=self.threads, tell=tell, on=self.on
        ) as own:
            window = min(4 * workers + 8, _MOST_IN_FLIGHT)
            yield OpenFarm(own.client, own.check, own.give_back, can, window)


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
        run = MappedJobs(farm, spec, independent=independent)
        try:
            for one in run.results(chain([first], iter_tasks), ordered=ordered):
                if one is not None:
                    yield one
                if asked.asked.is_set():
                    return
                farm.check()
                tick()
        finally:
            farm.give_back()
            run.close()
