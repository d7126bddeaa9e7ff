"""Renders toy scenes, in a render child: an even grey with even noise."""

from pathlib import Path

import numpy as np

from plateau.worker.renderers.canary import Canary
from plateau.worker.renderers.contract import Loaded, check_aovs
from toy_renderer.scenes import size_in

GREY = 0.25


def _film(width, height, spp, seed):
    samples = np.random.default_rng(seed).uniform(0, 2 * GREY, (spp, height, width, 3))
    weights = np.full((height, width, 1), spp)
    return np.concatenate([samples.sum(axis=0), weights], axis=-1).astype(np.float32)


class Renderer:
    """Toy scenes, as `plateau.worker.renderers.contract.Renderer` has them."""

    def __init__(self, variant, threads):
        self._size = None

    def probe(self):
        return Canary(film=_film(16, 16, 1024, 1), truth=np.full((16, 16, 3), GREY), spp=1024)

    def load(self, request):
        check_aovs(request.aovs, ())
        scene = (Path(request.folder) / request.entry).read_bytes()
        self._size = size_in(scene, request.parameters)
        return Loaded(width=self._size[0], height=self._size[1])

    def render(self, passes, *, zones=(), is_cancelled):
        for spp, seed in passes:
            if is_cancelled():
                return
            film = _film(*self._size, spp, seed)
            parts = [film[y : y + h, x : x + w].reshape(-1, 4) for x, y, w, h in zones]
            yield np.concatenate(parts) if parts else film
