"""Hosts Mitsuba, in the render child alone: loads one scene at a time and renders its passes."""

from __future__ import annotations

import gc
from dataclasses import dataclass
from typing import TYPE_CHECKING

import drjit as dr
import mitsuba as mi
import numpy as np

from worker.errors import SceneError
from worker.scene_prep import prepare, scene_errors

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from worker.scene_prep import PreparedScene


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
        self._prepared: PreparedScene | None = None

    def load(
        self, folder: Path, entry: str, parameters: Mapping[str, str], sensor: int = 0
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

        Raises
        ------
        SceneError
            Mitsuba refuses the scene, with its message, or the farm cannot render it. No scene
            is loaded then.
        """
        self._unload()
        prepared = prepare(self._variant, folder, entry, parameters, sensor)
        self._prepared = prepared
        return LoadedScene(prepared.width, prepared.height, prepared.notes)

    def render_pass(self, spp: int, seed: int) -> NDArray[np.float32]:
        """Return the film of one pass, before it is divided by its weights.

        Parameters
        ----------
        spp : int
            Samples per pixel, a power of two (see `farm.passes.passes`).
        seed : int
            Mitsuba's 32-bit seed, from a `farm.seeds.SeedSchedule`.

        Returns
        -------
        ndarray, shape (height, width, 4), float32
            R, G, B as sums weighted by the reconstruction filter, and the filter weights W.

        Raises
        ------
        SceneError
            The scene fails while it renders.
        """
        if spp < 1 or spp & (spp - 1):
            raise ValueError(f"a pass has a power of two of spp, not {spp}")
        if self._prepared is None:
            raise RuntimeError("no scene is loaded")
        one = self._prepared
        with scene_errors():
            # Mitsuba prepares (and so clears) the film and reseeds the sampler in each call:
            # nothing of a pass is left to the next.
            one.integrator.render(
                one.scene, one.sensor, seed=seed, spp=spp, develop=False, evaluate=True
            )
            film = np.array(one.film.bitmap(raw=True), dtype=np.float32)
        if film.shape != (one.height, one.width, 4):
            raise SceneError(f"the film has the shape {film.shape}, not R, G, B and weight")
        return film

    def _unload(self) -> None:
        """Free the scene before, so that two never share the memory."""
        self._prepared = None
        gc.collect()
        dr.flush_malloc_cache()
