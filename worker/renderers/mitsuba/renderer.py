"""Hosts Mitsuba, in the render child alone: loads one scene at a time and renders its passes."""

from __future__ import annotations

import gc
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import drjit as dr
import mitsuba as mi
import numpy as np

from plateau.worker.renderers.errors import SceneError
from plateau.worker.renderers.mitsuba.scene_prep import prepare, scene_errors

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from plateau.worker.renderers.mitsuba.scene_prep import PreparedScene


@dataclass(frozen=True)
class LoadedScene:
    """What is known of a scene once it is loaded.

    Attributes
    ----------
    width, height : int
        Pixels of the film's crop window (the whole film where it has none).
    notes : tuple of str
        What was changed in the scene, a sentence each.
    """

    width: int
    height: int
    notes: tuple[str, ...]


class Renderer:
    """Mitsuba in one variant, with at most one scene loaded.

    Parameters
    ----------
    variant : str
        The Mitsuba variant; a process can only ever use one. LLVM is loaded from
        ``DRJIT_LIBLLVM_PATH``.
    threads : int
        Threads that render, 1 or more. The samples do not depend on it.
    """

    def __init__(self, variant: str, threads: int) -> None:
        mi.set_variant(variant)
        mi.set_log_level(mi.LogLevel.Warn)  # of good scenes it says nothing
        dr.set_thread_count(threads)
        self._variant = variant
        self._runs_ahead = not variant.startswith("scalar")  # those render in the call itself
        self._prepared: PreparedScene | None = None

    def load(
        self,
        folder: Path,
        entry: str,
        parameters: Mapping[str, str],
        sensor: int = 0,
        *,
        threads: int,
    ) -> LoadedScene:
        """Load the scene of `entry` in `folder`, in the place of the one before.

        Parameters
        ----------
        folder : Path
            The scene's bundle; relative file names start here or beside `entry`.
        entry : str
            The scene's XML file, relative to `folder`.
        parameters : mapping of str to str
            Values for the scene's ``$parameters``, as Mitsuba's ``-D``.
        sensor : int
            Index of the sensor to render.
        threads : int
            How many load the scene, see `plateau.worker.supervisor.scene_cache.loading_threads`.

        Raises
        ------
        SceneError
            Mitsuba refuses the scene, with its message, or the farm cannot render it. No scene
            is loaded then.
        """
        self._unload()
        prepared = prepare(self._variant, folder, entry, parameters, sensor, threads)
        self._prepared = prepared
        return LoadedScene(prepared.width, prepared.height, prepared.notes)

    def render(
        self, passes: Iterable[tuple[int, int]], *, is_cancelled: Callable[[], bool]
    ) -> Iterator[NDArray[np.float32]]:
        """Yield the film of each pass, in order, before it is divided by its weights.

        The next pass is rendered already while a film is looked at, save by scalar variants: the
        cores do not wait for who adds it up.

        Parameters
        ----------
        passes : iterable of (int, int)
            Of each the samples per pixel, a power of two (see `plateau.farm.model.passes.passes`),
            and Mitsuba's 32-bit seed, from a `plateau.farm.model.seeds.SeedSchedule`.
        is_cancelled : callable
            Asked before a pass begins; once it says yes, none does any more.

        Yields
        ------
        ndarray, shape (height, width, 4), float32
            R, G, B as sums weighted by the reconstruction filter, and the filter weights W. To be
            read, and not kept.

        Raises
        ------
        SceneError
            The scene fails while it renders.
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
