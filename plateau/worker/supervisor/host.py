"""Keeps the render child, and the scene that it has loaded, from slice to slice."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

from plateau.farm.bundle.placed import path_for
from plateau.farm.ledger.queue import Lease
from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.model.renderers import variant_named
from plateau.farm.model.slices.rounds import slice_zones
from plateau.farm.process.settings import Settings
from plateau.worker.renderers.contract import Loaded, SceneError
from plateau.worker.supervisor.child_process import ChildDied, Film, RenderChild
from plateau.worker.supervisor.child_start import ChildLimits
from plateau.worker.supervisor.kinds import Kinds
from plateau.worker.supervisor.machine import memory_for_children
from plateau.worker.supervisor.scene_cache import SceneCache
from plateau.worker.supervisor.uploader import Glimpse, Rendered


class RenderHost:
    """At most one render child at a time, with at most one scene loaded."""

    def __init__(
        self,
        settings: Settings,
        threads: int,
        llvm_library: str | None,
        scenes: SceneCache,
        kinds: Kinds,
    ) -> None:
        self._settings = settings
        self._threads = threads
        self._llvm_library = llvm_library
        self._scenes = scenes
        self._kinds = kinds
        self._child: RenderChild | None = None
        self._child_is_for: tuple[str, tuple[int, int]] | None = None
        self._loaded: tuple[tuple[object, ...], Loaded] | None = None

    def warm_up(self, variant: str) -> None:
        """Start a child without waiting for it, so that it is ready for the first lease."""
        with suppress(OSError, StoreUnavailable):  # the first slice will meet the same error
            self._child_for(variant)

    def render(self, lease: Lease, show: Callable[[Glimpse], None]) -> Rendered:
        """Render the lease's slice.

        If a job's first slice takes a while, `show` is called with its first pass. Raises the
        errors of `RenderChild`, `SceneCache.scene`, `PlacedFiles.link` and `SeedSchedule`.
        """
        child = self._child_for(lease.variant)
        scene = self._load(child, lease)
        lease.spec.require_size(scene.width, scene.height)
        schedule = lease.spec.seed_schedule(lease.variant, scene.width, scene.height)
        first_seed, last_seed = schedule.seed_range(lease.index, lease.spp)
        zones = slice_zones(lease.spec, lease.round, scene.width, scene.height, scene.border)

        kind = self._kinds.named(lease.variant)

        def show_pass(film: Film, spp: int) -> None:
            show(
                Glimpse(
                    lease=lease,
                    scene=scene,
                    film=film,
                    spp=spp,
                    first_seed=first_seed,
                    zones=zones,
                    kind=kind,
                )
            )

        is_first = lease.index == 0
        film, render_s = child.render(
            schedule.passes(lease.index, lease.spp),
            show_pass if is_first and lease.spec.pictures else None,
            zones,
            lease.spec.inputs if is_first else (),
        )
        return Rendered(
            said=self.take_words(),
            lease=lease,
            scene=replace(scene, notes=(*scene.notes, *child.notes)),
            film=film,
            first_seed=first_seed,
            last_seed=last_seed,
            render_s=render_s,
            zones=zones,
            kind=kind,
            inputs=child.inputs,
        )

    def take_words(self) -> str:
        """Return what the child has printed since the last call."""
        return "" if self._child is None else self._child.take_words()

    @property
    def trouble(self) -> str | None:
        """What is wrong with a child that owes an answer; from any thread."""
        child = self._child
        return None if child is None else child.trouble

    @property
    def is_loading(self) -> bool:
        """Whether the child starts, or loads a scene; from any thread."""
        return self._loaded is None

    def cancel(self) -> None:
        """Cancel the child's request; from any thread."""
        child = self._child
        if child is not None:
            child.cancel()

    def close(self) -> None:
        """End the child."""
        if self._child is not None:
            self._child.kill()

    def _child_for(self, variant: str) -> RenderChild:
        # A child can open files in the folder that existed when it started, and in no other.
        scenes = self._scenes.make_folder()
        suits = (variant, scenes) == self._child_is_for
        if self._child is not None and self._child.alive and suits:
            return self._child
        self.close()
        self._loaded = None
        self._child_is_for = (variant, scenes)
        limits = ChildLimits(
            threads=self._threads,
            memory_bytes=self._memory_bytes() if variant_named(variant).is_confined else 0,
            timeout_s=self._settings.child_timeout_s,
        )
        home = self._settings.cache / "home"
        readable = [self._scenes.folder, *self._scenes.placed.folders]
        self._child = RenderChild(variant, self._llvm_library, limits, home, readable)
        return self._child

    def _memory_bytes(self) -> int:
        if self._settings.child_memory_gb:
            return int(self._settings.child_memory_gb * 1e9)
        return int(memory_for_children())

    def _load(self, child: RenderChild, lease: Lease) -> Loaded:
        spec = lease.spec
        aovs = spec.slice_aovs(lease.index)
        parameters = spec.parameter_strings()
        wanted = (
            lease.scene_sha256,
            tuple(sorted(parameters.items())),
            spec.sensor,
            aovs,
        )
        if self._loaded is None or self._loaded[0] != wanted:
            self._loaded = None
            folder, entry = self._scenes.scene(lease.scene_sha256)
            files, placed = folder.absolute(), self._scenes.placed
            roots = placed.link(files)
            here = {name: path_for(value, roots, files) for name, value in parameters.items()}
            try:
                loaded = child.load(files, entry, here, spec.sensor, aovs)
            except (SceneError, ChildDied):
                placed.link(files)  # files that have changed meanwhile are no fault of the scene's
                raise
            placed.link(files)  # they were the same while they were read
            self._loaded = (wanted, loaded)
        return self._loaded[1]
