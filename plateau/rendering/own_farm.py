"""A farm of one's own: processes of this machine, and workers here or on an engine's nodes."""

import math
import os
import secrets
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from plateau.errors import CommandFailed
from plateau.farm.bundle import BundleLimits, inspect_bundle, known_plugins
from plateau.farm.model.renderers import AUTO, renderer_of, variant_for, variant_named
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.files.packing import pack
from plateau.metric.kernel_cache import are_compiled
from plateau.processes.data_folder import DataFolder, is_in_use
from plateau.processes.ground import check_ground
from plateau.processes.interrupts import Interrupts
from plateau.processes.read_settings import read_settings
from plateau.processes.tree import Door, Tree
from plateau.worker.supervisor.gpus import uuids
from plateau.worker.supervisor.variants import choose, is_here

if TYPE_CHECKING:
    from plateau.client import Client
    from plateau.engines.fleet import Fleet
    from plateau.farm.model.job import Event
    from plateau.farm.process.settings import Settings
    from plateau.farm.wire.views import JobView
    from plateau.terminal.progress import Progress

_PREFIX: Final = "plateau-render-"
_MOST_DEATHS: Final = 3
_MOST_WORKERS: Final = 8
_LOOK_EVERY_S: Final = 2.0
#: With less room on the disk of its data, in bytes, a farm may soon wait for more.
_ROOM: Final = 64_000_000
#: Long enough for the tree to restart a dead API.
_PATIENCE_S: Final = 60.0


def checked_settings(scene: Path, spec: JobSpec, on: str | None = None) -> "Settings":
    """The settings of the environment, once all is checked that can be before a start.

    Raises
    ------
    BundleError
        The scene cannot be packed or is not allowed.
    CommandFailed
        This machine lacks the variant, or folders or open files; a rule cannot judge the image;
        there is no such engine.
    """
    settings = settings_here(on)
    parameters = spec.parameter_strings()
    limits = BundleLimits(settings.max_upload_bytes, plugins=known_plugins(settings.plugins))
    with pack(scene, parameters) as packed:
        found = inspect_bundle(
            packed.file, parameters=parameters, sensor=spec.sensor, limits=limits
        )
    try:
        if found.width and found.height:
            spec.require_size(found.width, found.height)
        variant = variant_for(spec.variant, found.renderer, is_whole=found.is_whole)
    except ValueError as error:
        raise CommandFailed(str(error)) from error
    check_variant(variant, settings.cache, on)
    return settings


def settings_here(on: str | None = None) -> "Settings":
    """The settings of the environment; raises `CommandFailed` where a farm cannot start here."""
    if on is not None:
        from plateau.engines.start import named

        named(on)
    settings = read_settings()
    check_ground(settings, caches=on is None, has_redis=True)
    return settings


def workers_for(variant: str) -> int:
    """How many workers do many small jobs best: one a GPU, or else one a core, each with a thread.

    Each has a scene in its memory. While one loads or hands over, others render.
    """
    on_gpu = variant == AUTO or variant_named(variant).on_gpu
    return (len(uuids()) if on_gpu else 0) or min(len(os.sched_getaffinity(0)), _MOST_WORKERS)


@dataclass(eq=False)
class OwnFarm:
    """A farm of one's own: the processes of this machine, and the nodes of an engine."""

    client: "Client"
    _tree: Tree
    _fleet: "Fleet | None"
    _tell: Callable[[str], None]
    _look_at_s: float = 0.0  #: whether a job waits for other nodes than came
    _is_full: bool = False  #: its disk, nearly

    def check(self) -> None:
        """Restart what died, and pass on news; call it a few times a second.

        Raises `PlateauError` where a process of this machine keeps dying, or no node works.
        """
        self._tree.check()
        was_full, room = self._is_full, shutil.disk_usage(tempfile.gettempdir()).free
        self._is_full = room < _ROOM
        if self._is_full and not was_full:
            self._tell(
                f"{tempfile.gettempdir()} has only {room // 1_000_000} MB left: what does not fit "
                "waits for room; free some, or begin anew with TMPDIR on another disk"
            )
        if self._fleet is not None:
            self._fleet.check(self._tell)
            if self._fleet.heard and time.monotonic() >= self._look_at_s:
                self._look_at_s = time.monotonic() + _LOOK_EVERY_S
                for job in self.client.all_jobs(state=JobState.QUEUED, limit=1):
                    if job.waits_for:  # no node that came can render it
                        self._tell(f"job {job.name} {job.waits_for}")
                        self._look_at_s = math.inf

    def give_back(self) -> None:
        """Give the engine's nodes back at once: nothing more is to be rendered."""
        if self._fleet is not None:
            self._fleet.give_back()


@contextmanager
def own_farm(
    settings: "Settings",
    interrupts: Interrupts,
    spec: JobSpec,
    *,
    workers: int,
    threads: int | None,
    tell: Callable[[str], None],
    on: str | None = None,
) -> Iterator[OwnFarm]:
    """A farm for as long as the context lasts; call its `check` often.

    Parameters
    ----------
    settings
        Those of `checked_settings` or `settings_here`.
    interrupts
        The first one ends the start by `KeyboardInterrupt`; the second one forces the stop.
    spec
        The workers fit it, whatever the settings say.
    workers, threads
        Number of workers, and threads of each; None for the machine's cores, shared by the workers,
        or those that the engine gives.
    tell
        Called with a line about each process that is started again, and news of the nodes.
    on
        The engine that brings the workers, and its options: ``slurm --partition=cpu``; None for
        this machine. See `plateau.engines`.
    """
    alone = settings.model_copy(
        update={
            "redis_url": None,
            "blobs": None,
            "threads": threads or (settings.threads if on is None else None),
            "pool": spec.pool,
            "tags": spec.requires,
        }
    )
    with ExitStack() as stack:
        data = stack.enter_context(_temporary_data())
        tree = Tree(
            alone,
            data,
            interrupts,
            workers=workers if on is None else 0,
            door=Door(),
            tell=tell,
            most_deaths=_MOST_DEATHS,
            is_temporary=True,
            secret="" if on is None else secrets.token_hex(16),
        )
        stack.enter_context(tree)
        # These imports take place while the tree's processes start.
        from plateau.farm.ledger.api_keys import ApiKeys, KeyLimits, Role
        from plateau.farm.redis.link import connect

        with connect(tree.redis_url) as redis:  # before the API listens: nobody else has a key
            _, key = ApiKeys(redis).create("a user", Role.ADMIN, KeyLimits())
        fleet = None
        if on is not None:
            from plateau.engines.start import nodes

            fleet = stack.enter_context(nodes(on, tree, workers))
        import plateau.rendering.outputs
        import plateau.terminal.progress  # noqa: F401
        from plateau.client import Client

        client = stack.enter_context(Client(tree.await_api(), key=key, patience_s=_PATIENCE_S))
        yield OwnFarm(client, tree, fleet, tell)


@contextmanager
def rendered_alone(
    scene: Path,
    spec: JobSpec,
    settings: "Settings",
    interrupts: Interrupts,
    *,
    workers: int,
    threads: int | None,
    on: str | None,
    progress: Callable[["Client"], "Progress"],
) -> Iterator[tuple["Client", "JobView"]]:
    """The job of a scene, once it has ended; the client has its results while the context lasts.

    Parameters
    ----------
    settings
        Those of `checked_settings`.
    interrupts
        The first cancels the job; the second, or one before an image, raises `KeyboardInterrupt`.
    workers, threads, on
        As for `own_farm`.
    progress
        Makes what shows the job.
    """
    # The wait for the workers counts: no other job keeps them.
    spec = spec.model_copy(update={"time_limit_from": "submission"})
    with own_farm(
        settings,
        interrupts,
        spec,
        workers=workers,
        threads=threads,
        tell=lambda line: shown.note(line),
        on=on,
    ) as farm:
        shown = progress(farm.client)
        yield farm.client, _run(scene, spec, farm, interrupts, shown)


def check_variant(variant: str, cache: Path, on: str | None) -> None:
    """Refuse a variant that the workers of this machine will lack: the job would wait for ever.

    The cache keeps the result, so the workers need not try again. An engine's are not here yet.
    """
    if variant == "auto" or on is not None:
        return
    if not is_here(variant):
        missing = renderer_of(variant).missing
        raise CommandFailed(f"this machine cannot render with {variant}: {missing}")
    choice = choose(cache)
    if variant in choice.variants:
        return
    tried = [one.detail for one in choice.tried if one.variant == variant]
    others = ", ".join(choice.like(variant))
    raise CommandFailed(
        f"this machine cannot render with {variant}{f' ({tried[0]})' if tried else ''}; "
        f"{f'it can with {others}: leave --variant out, or ' if others else ''}see `plateau doctor`"
    )


def _run(
    scene: Path, spec: JobSpec, farm: OwnFarm, interrupts: Interrupts, shown: "Progress"
) -> "JobView":
    """Submit the job and follow it to its end; the first interrupt cancels it."""
    from plateau.client.events import is_rendered
    from plateau.rendering.follow import cancelling, follow, worth_keeping

    with interrupts.ended_by(interrupts.asked):
        job = farm.client.submit(scene, spec)
    if not are_compiled():
        shown.note("compiling the model of vision, once on this machine: it takes half a minute")
    cancel_if_asked = cancelling(farm.client, job.id, interrupts, shown)

    def tick(event: "Event | None") -> None:
        if event is not None and is_rendered(event):
            farm.give_back()
        farm.check()
        cancel_if_asked(event)

    return worth_keeping(follow(farm.client, job.id, shown, tick), interrupts)


@contextmanager
def _temporary_data() -> Iterator[DataFolder]:
    """A data folder that is removed at the end; removes first what killed trees have left."""
    for left in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        if not is_in_use(left):
            shutil.rmtree(left, ignore_errors=True)
    with (
        tempfile.TemporaryDirectory(prefix=_PREFIX, ignore_cleanup_errors=True) as folder,
        DataFolder(Path(folder)) as data,
    ):
        yield data
