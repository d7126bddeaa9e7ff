"""What a blend by risk could save at best: its weights are by the true errors, of a recording."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bench.allocating.truth import quarters_noise, wrong_share
from plateau.metric.denoise import smoothed

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from plateau.metric import Denoise, Image, VisibleDifferences

#: By what the slices grow from one image to the next.
_GROWTH = 1.15


class Shares(NamedTuple):
    """The shares of an image's pixels that are visibly wrong."""

    spp: int
    raw: float
    blend: float  #: of the image and its denoised self, by what each is wrong in truth


def shares(
    recording: NDArray[np.float32],
    slice_spp: int,
    order: NDArray[np.intp],
    denoise: Denoise,
    metric: VisibleDifferences,
) -> Iterator[Shares]:
    """Yield the shares of more and more slices, as long as half of the recording remains."""
    total = recording.sum(axis=0, dtype=np.float64)
    sums, done, slices = np.zeros((4, *recording.shape[1:])), 0, 4
    while slices <= len(recording) // 2:
        for place in range(done, slices):
            sums[place % 4] += recording[order[place]]
        done, left = slices, len(recording) - slices
        image = _image(sums.sum(axis=0) / slices)
        reference, clean = _image((total - sums.sum(axis=0)) / left), denoise(image)
        own, noise = quarters_noise(4 * sums / slices, slices / left)
        variance = _energy(image, image - own) * np.float32(slices / left)  # of the reference
        risk, bias = (_pooled(_energy(each, reference) - variance) for each in (image, clean))
        weight = (risk / np.maximum(risk + bias, np.float32(1e-30)))[..., np.newaxis]
        blend = weight * clean + (1 - weight) * image
        wrong = (wrong_share(metric, reference, noise, each, own) for each in (image, blend))
        yield Shares(slices * slice_spp, *wrong)
        slices = max(slices + 4, int(slices * _GROWTH) // 4 * 4)


def _image(values: NDArray[np.float64]) -> Image:
    return values.astype(np.float32)


def _energy(one: Image, other: Image) -> NDArray[np.float32]:
    """Return the squared difference of each pixel, of light that is clipped as on the screen."""
    apart: NDArray[np.float32] = np.square(one.clip(0, 1) - other.clip(0, 1)).sum(axis=-1)
    return apart


def _pooled(plane: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the plane pooled around each pixel, as the blend pools its risks."""
    pooled: NDArray[np.float32] = np.maximum(smoothed(smoothed(plane, 1), 2), 0)
    return pooled
