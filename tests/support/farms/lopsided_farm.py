"""A farm whose images are noisy to the left, and jobs whose samples go there."""

from dataclasses import replace
from typing import Any

from plateau.farm.images.exr import Pixels, decode_partial, encode_partial
from plateau.farm.ledger.queue import Lease
from tests.support.farms.noise_farm import NoiseFarm, ramp

HEIGHT, WIDTH = 16, 96
ZONES = {"allocation": {"name": "zones", "size": 16}, "step": 40, "slice_spp": 10}
JOB = {**ZONES, "rule": {"name": "visible", "target": 0.02}, "max_spp": 4000}


class Lopsided:
    """A picture with noise in its left third."""

    def __init__(self, sigma: float) -> None:
        self._noisy, self._calm = (ramp(level, size=(HEIGHT, WIDTH)) for level in (sigma, 0.01))
        self.channels = self._noisy.channels

    def film(self, spp: int, seed: int) -> Pixels:
        film = self._calm.film(spp, seed)
        film[:, :32] = self._noisy.film(spp, seed)[:, :32]
        return film


class LopsidedFarm(NoiseFarm):
    """A farm whose slices are noisy to the left."""

    variant = "llvm_ad_rgb"
    size = (HEIGHT, WIDTH)

    def __init__(self, *arguments: Any, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self.wrong: dict[str, Any] = {}  #: what its worker says of a slice instead

    def _shown(self, _: Lease) -> Lopsided:
        return Lopsided(self.sigma)

    def _partial(self, lease: Lease, spp: int, film: Pixels) -> bytes:
        made = decode_partial(super()._partial(lease, spp, film))
        return encode_partial(replace(made, **self.wrong))
