"""The jobs of `plateau.map` that are under way on a farm: submitted some at a time, and fetched."""

import os
import secrets
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any, Final

from plateau.client import ApiError, Client
from plateau.client.events import is_rendered
from plateau.client.submission import spec_of
from plateau.errors import CommandFailed, needs
from plateau.farm.bundle import BundleError
from plateau.farm.model.errors import InvalidSpec
from plateau.farm.model.job import Event
from plateau.farm.model.seeds import JOB_SEEDS
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.wire.views import JobView
from plateau.rendering.mapped import Mapped, Task
from plateau.rendering.result import IMAGE, Result

_TICK_S: Final = 0.25
#: The wait for a submission that is under way as all ends.
_LAST_WORDS_S: Final = 5.0
#: How far the seed of an independent input is from that of its reference: odd, as the number of
#: seeds is often a power of two.
_APART: Final = JOB_SEEDS // 2 + 1
_UNREADABLE: Final = (PermissionError, FileNotFoundError)  #: a file of a scene's
#: Answers of a service that are the caller's fault, and no scene's.
_NOT_OF_A_SCENE: Final = frozenset({401, 403, 408, 409, 429})


@dataclass(frozen=True)
class OpenFarm:
    """A farm that renders images."""

    client: Client
    check: Callable[[], None]  #: to be called a few times a second
    give_back: Callable[[], None]  #: to be called, in any thread, once nothing is to be rendered
    check_variant: Callable[[str], None]  #: raises where a job of this variant would wait for ever
    window: int  #: the most images that are submitted and not yet taken


class MappedJobs:
    """The images that are under way on a farm."""

    def __init__(self, farm: OpenFarm, spec: JobSpec, *, independent: bool) -> None:
        self._client, self._give_back = farm.client, farm.give_back
        self._check_variant = farm.check_variant
        self._window, self._chunk = farm.window, max(1, farm.window // 3)
        self._name = f"map-{secrets.token_hex(4)}"
        self._batches = 0
        self._lock = threading.Lock()
        self._to_render: set[int] = set()  # tasks that were read and need samples
        self._all_read = False
        self._open: dict[str, set[str]] = {}  # by batch, its jobs that were not fetched
        self._submissions: set[Future[list[tuple[Task, Future[Mapped] | str]]]] = set()
        self._has_values = spec.rule.name != "fixed" or bool(spec.watch)
        self._known: dict[str, str] = {}  # the SHA-256 of scenes that are stored, by their paths
        self._pool = ThreadPoolExecutor(farm.window + 1, thread_name_prefix="map")
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
        tasks = self._counted(tasks)
        submissions = self._submissions
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
                for task, fetch in made.result():
                    if isinstance(fetch, str):
                        ready[task.index] = Mapped(task=task, failure=fetch)
                    else:
                        fetches.add(fetch)
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
        self._client._transport.once_heard_s = 0.0  # a service that is away is not waited for
        wait(self._submissions, _LAST_WORDS_S)  # what is being submitted has to be cancelled, too
        with self._lock:
            left = [name for name, jobs in self._open.items() if jobs]
        with suppress(Exception):
            for batch in left:
                try:
                    self._client.cancel_batch(batch)
                except ApiError as error:
                    if error.status >= 500:  # nor would it take the others
                        raise

    def _counted(self, tasks: Iterator[Task]) -> Iterator[Task]:
        """The tasks, each read before it is wanted: so the last one is known as such."""
        coming = next(tasks, None)
        while coming is not None:
            task, coming = coming, next(tasks, None)
            with self._lock:
                self._to_render.add(task.index)
                self._all_read = coming is None
            yield task

    def _rendered(self, task: Task) -> None:
        """The task needs no more samples; if it was the last one, nobody needs the nodes."""
        with self._lock:
            self._to_render.discard(task.index)
            is_over = self._all_read and not self._to_render
        if is_over:
            self._give_back()

    def _submit(self, tasks: Sequence[Task]) -> list[tuple[Task, Future[Mapped] | str]]:
        """Submit alike tasks; returns for each what fetches it, or why there is nothing."""
        try:
            made = [self._jobs(tasks, spec, far * _APART) for far, spec in enumerate(self._specs)]
        except CommandFailed as error:  # this machine lacks the variant of their scene
            for one in tasks:
                self._rendered(one)
            return [(one, str(error)) for one in tasks]
        except (BundleError, InvalidSpec, ApiError, *_UNREADABLE, _MakerFailed) as error:
            if isinstance(error, ApiError) and (
                error.status >= 500 or error.status in _NOT_OF_A_SCENE
            ):
                raise
            if len(tasks) == 1:
                self._rendered(tasks[0])
                return [(tasks[0], str(error))]
            middle = len(tasks) // 2  # the others are not to blame
            return self._submit(tasks[:middle]) + self._submit(tasks[middle:])
        each = zip(tasks, zip(*made, strict=True), strict=True)
        return [(task, self._pool.submit(self._fetch, task, jobs)) for task, jobs in each]

    def _jobs(self, tasks: Sequence[Task], spec: JobSpec, apart: int) -> list[JobView]:
        """The jobs of alike tasks, in their order."""
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
        self._check_variant(jobs[0].spec.variant)
        if not isinstance(path, Mapping):
            self._known[path] = jobs[0].scene_sha256
        with self._lock:
            self._open[name] = {job.id for job in jobs}
        by_frame = {(job.spec.frame_seed - frame) % JOB_SEEDS: job for job in jobs}
        return [by_frame[place] for place in range(len(tasks))]

    def _fetch(self, task: Task, jobs: Sequence[JobView]) -> Mapped:
        """Wait for the jobs of a task, and fetch them."""
        *others, last = jobs

        def heard(event: Event) -> None:
            if is_rendered(event):
                self._rendered(task)

        done = [self._client.wait(job.id) for job in others]
        done.append(self._client.wait(last.id, on_event=heard))
        results = [self._fetched(job) for job in done]
        failed = next((one for one in results if not one.has_image), None)
        found = Mapped(task=task, result=results[0], noisy=(*results, None)[1])
        if failed is not None:
            return replace(found, failure=failed.reason)
        if results[0].state in {JobState.FAILED, JobState.CANCELLED}:
            return replace(found, failure=results[0].reason)
        if found.noisy is not None and _overlap(results[0], found.noisy):
            why = "its variant has too few seeds for inputs that are independent of the image"
            return replace(found, failure=why)
        return found

    def _fetched(self, job: JobView) -> Result:
        result = Result.fetched(self._client, job, (IMAGE,), with_curve=self._has_values)
        batch = job.spec.batch or ""
        with self._lock:
            jobs = self._open.get(batch, {job.id})
            jobs.discard(job.id)
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
        header = decode_header(one.files[IMAGE])
        ranges.append([int(header[f"plateau:{end}_seed"]) for end in ("first", "last")])
    (first, last), (other_first, other_last) = ranges
    return first <= other_last and other_first <= last
