"""Hosts Mitsuba, in the render child alone: loads one scene at a time and renders its passes."""

from __future__ import annotations

import gc
from typing import TYPE_CHECKING

import drjit as dr
import mitsuba as mi
import numpy as np

from plateau.worker.renderers.contract import Loaded, SceneError
from plateau.worker.renderers.mitsuba.kernel import Kernel
from plateau.worker.renderers.mitsuba.scene_prep import prepare, scene_errors

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from plateau.farm.model.zones import Zone
    from plateau.worker.renderers.contract import Load
    from plateau.worker.renderers.mitsuba.scene_prep import PreparedScene


class Renderer:
    """Mitsuba as `plateau.worker.renderers.contract.Renderer` has it.

    A process can only ever use one variant. LLVM is loaded from ``DRJIT_LIBLLVM_PATH``.
    """

    def __init__(self, variant: str, threads: int) -> None:
        mi.set_variant(variant)
        mi.set_log_level(mi.LogLevel.Warn)  # of good scenes it says nothing
        dr.set_thread_count(threads)
        self._variant = variant
        self._prepared: PreparedScene | None = None
        self._kernel: Kernel | None = None

    def probe(self) -> None:
        """Render a small Cornell box with a path tracer; raise where its image is none."""
        scene = mi.cornell_box()
        scene["sensor"]["film"].update(width=16, height=16)
        image = np.array(mi.render(mi.load_dict(scene), spp=4, seed=1))
        if not (np.isfinite(image).all() and image.mean() > 0):
            raise ArithmeticError("the image is black or not finite")

    def load(self, request: Load) -> Loaded:
        """Load a scene in the place of the one before; errors carry Mitsuba's message."""
        self._unload()
        self._prepared = one = prepare(self._variant, request)
        if not self._variant.startswith("scalar"):
            self._kernel = Kernel(one)
        return Loaded(
            width=one.width,
            height=one.height,
            channels=one.channels.names,
            ids=one.channels.ids,
            border=0 if self._kernel is None else self._kernel.border,
            notes=one.notes,
        )

    def render(
        self,
        passes: Iterable[tuple[int, int]],
        *,
        zones: Sequence[Zone] = (),
        is_cancelled: Callable[[], bool],
    ) -> Iterator[NDArray[np.float32]]:
        """Yield the film of each pass, in order, before it is divided by its weights."""
        if self._prepared is None:
            raise RuntimeError("no scene is loaded")
        if self._kernel is not None:
            yield from self._kernel.films(passes, zones, is_cancelled)
            return
        if zones:
            raise SceneError(f"the variant {self._variant} renders whole films, and no zones")
        for spp, seed in passes:
            if is_cancelled():
                return
            yield _rendered(self._prepared, spp, seed)

    def _unload(self) -> None:
        """Free the scene before, so that two never share the memory."""
        self._prepared = self._kernel = None
        gc.collect()
        dr.flush_malloc_cache()


def _rendered(one: PreparedScene, spp: int, seed: int) -> NDArray[np.float32]:
    """Return the film of a pass that Mitsuba renders by itself, as scalar variants do."""
    if spp < 1 or spp & (spp - 1):
        raise ValueError(f"a pass of a scalar variant has a power of two of spp, not {spp}")
    with scene_errors():
        # Mitsuba prepares (and so clears) the film and reseeds the sampler in each call: nothing of
        # a pass is left to the next.
        one.integrator.render(one.scene, one.sensor, seed=seed, spp=spp, develop=False)
        film: NDArray[np.float32] = np.array(one.film.develop(raw=True))
    alpha = 3  # Mitsuba has it before W
    order = [0, 1, 2, alpha + 1, alpha] if one.channels.has_alpha else [0, 1, 2, alpha]
    return film[..., [*order, *(len(order) + index for index in one.channels.aovs)]]
