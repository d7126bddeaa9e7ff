"""Renders analytic scenes, in a render child."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from plateau.farm.bundle import BundleError, BundleLimits
from plateau.farm.bundle.analytic import AnalyticScene, read_analytic_scene
from plateau.worker.renderers.analytic.aovs import GEOMETRY
from plateau.worker.renderers.analytic.picture import Picture
from plateau.worker.renderers.canary import Canary
from plateau.worker.renderers.contract import Loaded, SceneError, check_aovs

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from plateau.farm.model.slices.zones import Zone
    from plateau.worker.renderers.contract import Load


class Renderer:
    """Analytic scenes, as `plateau.worker.renderers.contract.Renderer` has them.

    It cannot render more than one sensor, and one thread does all: the number has no effect.
    """

    def __init__(self, variant: str, threads: int) -> None:  # noqa: ARG002  (see above)
        if variant != "numpy":
            raise ValueError(f"analytic scenes have no variant {variant!r}, but numpy alone")
        self._picture: Picture | None = None

    def probe(self) -> Canary:
        """Render a small image, whose truth is known as that of all analytic scenes."""
        picture, spp = Picture(AnalyticScene(width=32, height=32)), 1024
        truth = picture.truth.astype(np.float64)
        return Canary(film=picture.film(spp, 1), truth=truth, spp=spp)

    def load(self, request: Load) -> Loaded:
        """Read a scene's file, in the place of the one before."""
        self._picture = None
        try:
            with (Path(request.folder) / request.entry).open("rb") as file:
                scene, _ = read_analytic_scene(file, request.parameters, BundleLimits())
        except BundleError as error:
            raise SceneError(str(error)) from error
        if request.sensor != 0:
            raise SceneError("an analytic scene has sensor 0 alone")
        check_aovs(request.aovs, GEOMETRY)
        self._picture = Picture(scene, request.aovs)
        return Loaded(
            width=scene.width,
            height=scene.height,
            channels=tuple(self._picture.channels.names),
            ids=tuple(self._picture.channels.ids),
        )

    def render(
        self,
        passes: Iterable[tuple[int, int]],
        *,
        zones: Sequence[Zone] = (),
        is_cancelled: Callable[[], bool],
    ) -> Iterator[NDArray[np.float32]]:
        """Yield the film of each pass, in order."""
        if self._picture is None:
            raise RuntimeError("no scene is loaded")
        for spp, seed in passes:
            if is_cancelled():
                return
            film = self._picture.film(spp, seed)
            parts = [film[y : y + h, x : x + w].reshape(-1, film.shape[-1]) for x, y, w, h in zones]
            yield np.concatenate(parts) if parts else film
