"""What other renderers deliver of recorded slices: their own rule stops, then they denoise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.experiment.other_rules import CyclesAdaptive, CyclesThreshold, LuxCoreHalt

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from plateau.metric import Denoise, Image, View

#: Cycles by its noise threshold: that of a final render, and that of its viewport.
CYCLES: Final = {"Cycles, 0.01": 0.01, "Cycles, 0.1": 0.1}
LUXCORE: Final = "LuxCore"
PEERS: Final = (*CYCLES, LUXCORE)
#: LuxCore checks every 64 spp.
_LUXCORE_SPP: Final = 64


@dataclass(frozen=True)
class Delivered:
    """An image that a renderer delivers, and what it took."""

    peer: str
    spp: float  #: a mean, where pixels end by themselves
    slices: int  #: of the recording, of which its samples are
    image: Image


def delivered(
    recording: NDArray[np.float32], slice_spp: int, denoise: Denoise, view: View
) -> Iterator[Delivered]:
    """Yield what each renderer delivers that stops within the first half of a recording.

    Cycles ends pixels by themselves, and here checks after every two slices. LuxCore ends all at
    its threshold of 0.02, and checks once as many slices are there as have 64 spp.
    """
    luxcore, every = LuxCoreHalt(view), -(-_LUXCORE_SPP // slice_spp)
    cycles = {name: CyclesAdaptive(CyclesThreshold(limit)) for name, limit in CYCLES.items()}
    total = np.zeros(recording.shape[1:])
    weight = np.ones((*recording.shape[1:3], 1), np.float32)
    first, luxcore_goes_on = None, True
    for slices, mean in enumerate(recording[: len(recording) // 2], 1):
        total += mean
        film = np.concatenate([mean, weight], axis=-1)
        if first is None:
            first = film
        else:
            ended = [name for name, one in cycles.items() if one.add(first, film, 2 * slice_spp)]
            for name in ended:
                one = cycles.pop(name)
                yield Delivered(name, one.mean_spp, slices, denoise(one.image))
            first = None
        if luxcore_goes_on and slices % every == 0:
            image = (total / slices).astype(np.float32)
            if luxcore.stops(slices * slice_spp, image):
                luxcore_goes_on = False
                yield Delivered(LUXCORE, slices * slice_spp, slices, denoise(image))
