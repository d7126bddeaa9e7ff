"""Hosts Mitsuba, in the render child alone: loads one scene at a time and renders its passes."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import TYPE_CHECKING, Any

import drjit as dr
import mitsuba as mi
import numpy as np

from plateau.worker.renderers.contract import Loaded, SceneError
from plateau.worker.renderers.mitsuba.scene_prep import prepare, scene_errors

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from numpy.typing import NDArray

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
        self._runs_ahead = not variant.startswith("scalar")  # those render in the call itself
        self._prepared: PreparedScene | None = None

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
        self._prepared = one = prepare(
            self._variant,
            Path(request.folder),
            request.entry,
            request.parameters,
            request.sensor,
            request.threads,
        )
        return Loaded(width=one.width, height=one.height, notes=one.notes)

    def render(
        self, passes: Iterable[tuple[int, int]], *, is_cancelled: Callable[[], bool]
    ) -> Iterator[NDArray[np.float32]]:
        """Yield the film of each pass, in order, before it is divided by its weights.

        The next pass already renders while the caller looks at a film, so that the cores do not
        wait. Scalar variants render in the call itself.
        """
        if self._prepared is None:
            raise RuntimeError("no scene is loaded")
        finished = None
        for spp, seed in passes:
            if is_cancelled():
                break
            rendering = _begun(self._prepared, spp, seed)
            if finished is not None:
                yield finished
            finished = _finished(self._prepared, rendering)
            if not self._runs_ahead:
                yield finished
                finished = None
        if finished is not None:
            yield finished

    def _unload(self) -> None:
        """Free the scene before, so that two never share the memory."""
        self._prepared = None
        gc.collect()
        dr.flush_malloc_cache()


def _begun(one: PreparedScene, spp: int, seed: int) -> Any:
    """Return the film of a pass that is being rendered; scalar variants return it rendered."""
    if spp < 1 or spp & (spp - 1):
        raise ValueError(f"a pass has a power of two of spp, not {spp}")
    with scene_errors():
        # Mitsuba prepares (and so clears) the film and reseeds the sampler in each call: nothing of
        # a pass is left to the next.
        one.integrator.render(
            one.scene, one.sensor, seed=seed, spp=spp, develop=False, evaluate=False
        )
        film = one.film.develop(raw=True)
        dr.eval(film)  # waits for nothing
    return film


def _finished(one: PreparedScene, rendering: Any) -> NDArray[np.float32]:
    """Wait for a film; return it, without a copy where it lies in this memory."""
    with scene_errors():
        film: NDArray[np.float32] = rendering.numpy()
    if film.shape != (one.height, one.width, 4):
        raise SceneError(
            f"the film came out with the shape {film.shape}, where the farm expects "
            f"{(one.height, one.width, 4)}: red, green, blue and weight"
        )
    return film
