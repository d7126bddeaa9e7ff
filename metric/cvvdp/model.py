"""`ColorVideoVDP`: two images on a display, and the quality of one against the other in JOD."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from plateau.metric.cvvdp.bands import contrasts, masked
from plateau.metric.cvvdp.light import opponent, screen
from plateau.metric.cvvdp.parameters import (
    BASE_WEIGHTS,
    CHANNEL_EXPONENT,
    CHANNELS,
    LEAST_BACKGROUND,
    PIXEL_EXPONENT,
    STILL_WEIGHT,
)
from plateau.metric.cvvdp.pooling import jod, norm, quality, raised
from plateau.metric.cvvdp.pyramid import band_frequencies, expanded, halved
from plateau.metric.cvvdp.sensitivity import log_sensitivities, sensitivities
from plateau.metric.display import as_image, require_same_size

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from plateau.metric.cvvdp.display import Display
    from plateau.metric.display import Plane

#: The least height and width of an image, in pixels.
LEAST_SIZE = 4


@dataclass(frozen=True, eq=False)
class Percept:
    """One image, prepared for comparison on one display."""

    display: Display
    #: Opponent colour in cd/m², each level (3, H, W) and half the size of the one before.
    levels: tuple[Plane, ...]

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        _, height, width = self.levels[0].shape
        return height, width


@dataclass(frozen=True, eq=False)
class Quality:
    """How a test image compares with a reference."""

    #: 10 where nobody sees a difference; one less where three of four prefer the reference.
    jod: float
    #: What each channel and band contributes, (3, bands), from the finest band to the base.
    differences: NDArray[np.float64]
    #: Where a person would see it, (H, W) float32 in [0, 1], tenths of a JOD per pixel; or None.
    heat: Plane | None


class ColorVideoVDP:
    """The model for stills on one display.

    Parameters
    ----------
    display
        The screen, the room and the distance.
    threads
        How many threads share the rows. The result has the same bits for any number.

    Examples
    --------
    >>> from plateau.metric.cvvdp import DISPLAYS
    >>> model = ColorVideoVDP(DISPLAYS["standard_fhd"])
    >>> grey = np.full((64, 64, 3), 0.5, np.float32)
    >>> spot = grey.copy()
    >>> spot[30:34, 30:34] = 1.0
    >>> model.compare(model.percept(grey), model.percept(grey)).jod
    10.0
    >>> model.compare(model.percept(grey), model.percept(spot)).jod < 9.5
    True
    """

    def __init__(self, display: Display, threads: int = 1) -> None:
        self.display = display
        self.threads = threads
        self._screen = screen(display)

    def percept(self, image: NDArray[Any]) -> Percept:
        """Return everything that depends on this image only.

        Parameters
        ----------
        image
            (H, W, 3), of any real dtype, at least 4 by 4 pixels, in the display's transfer.

        Raises
        ------
        ValueError
            If the image is not (H, W, 3), too small, not finite everywhere, or has code values
            outside [0, 1].
        """
        image = as_image(image)
        height, width, _ = image.shape
        if min(height, width) < LEAST_SIZE:
            raise ValueError(f"an image of {width}×{height} pixels is too small: at least 4×4")
        if not np.isfinite(image).all():
            raise ValueError("an image for ColorVideoVDP has to be finite in every pixel")
        if self.display.transfer not in ("relative", "absolute"):
            least, greatest = float(image.min()), float(image.max())
            if least < 0 or greatest > 1:
                raise ValueError(f"code values lie in [0, 1], not in [{least:g}, {greatest:g}]")
        colour = np.empty((CHANNELS, height, width), np.float32)
        pixels = np.ascontiguousarray(image).reshape(height, 3 * width)
        self._share(height, lambda start, end: opponent(pixels, self._screen, start, end, colour))
        levels = [colour]
        for _ in band_frequencies((height, width), self.display.pixels_per_degree)[1:]:
            levels.append(self._halved(levels[-1]))
        return Percept(self.display, tuple(levels))

    def compare(self, reference: Percept, test: Percept, *, heat: bool = False) -> Quality:
        """Return the quality of the test image, with a heat map if asked.

        The comparison is not symmetric: the eye is adapted to the reference.

        Raises
        ------
        ValueError
            If the images differ in size, or were prepared for another display.
        """
        require_same_size(reference.shape, test.shape)
        for percept in (reference, test):
            if percept.display != self.display:
                raise ValueError(f"an image prepared for {percept.display} met {self.display}")
        frequencies = band_frequencies(reference.shape, self.display.pixels_per_degree)
        pooled, maps = [], []
        for band, frequency in enumerate(frequencies[:-1]):
            sums, strength = self._band(reference, test, band, frequency, heat)
            pooled.append(sums)
            maps.append(strength)
        sums, strength = _base(reference.levels[-1], test.levels[-1], frequencies[-1])
        differences = np.stack([*pooled, sums], axis=1)
        heat_map = _reconstructed([*maps, strength]) if heat else None
        return Quality(quality(differences), differences, heat_map)

    def _band(
        self, reference: Percept, test: Percept, band: int, frequency: float, heat: bool
    ) -> tuple[NDArray[np.float64], Plane]:
        """Return each channel's pooled difference in a band, and its map."""
        ours, our_next = reference.levels[band : band + 2]
        theirs, their_next = test.levels[band : band + 2]
        _, height, width = ours.shape
        # A band's kernel lets half of its contrast through, except for the finest.
        scale = np.float32(1 if band == 0 else 2)
        table = log_sensitivities(frequency)
        differences, common = np.empty_like(ours), np.empty_like(ours)
        self._share(
            height,
            lambda start, end: contrasts(
                ours,
                our_next,
                theirs,
                their_next,
                table,
                scale,
                start,
                end,
                differences,
                common,
            ),
        )
        sums = np.empty((CHANNELS, height))
        strength = np.empty((height, width) if heat else (0, 0), np.float32)
        self._share(
            height, lambda start, end: masked(differences, common, start, end, sums, strength)
        )
        mean = sums.sum(axis=1) / (height * width)
        if heat and band > 0:
            strength *= np.float32(0.5)
        return raised(mean, 1 / PIXEL_EXPONENT), strength

    def _halved(self, level: Plane) -> Plane:
        if self.threads == 1:
            return halved(level)
        with ThreadPoolExecutor(self.threads) as pool:
            return np.concatenate(list(pool.map(halved, np.split(level, CHANNELS))))

    def _share(self, rows: int, work: Callable[[int, int], None]) -> None:
        """Call the work for ranges of rows, one for each thread."""
        edges = np.linspace(0, rows, self.threads + 1).astype(int).tolist()
        if self.threads == 1:
            work(0, rows)
            return
        with ThreadPoolExecutor(self.threads) as pool:
            list(pool.map(work, edges[:-1], edges[1:]))


def _base(reference: Plane, test: Plane, frequency: float) -> tuple[NDArray[np.float64], Plane]:
    """Return each channel's pooled difference in the base band, and its map.

    D = S |test / mean(test) - reference / mean(reference)|, with the means of luminance.
    """
    ours, theirs = (np.maximum(level[0], LEAST_BACKGROUND).mean() for level in (reference, test))
    sensitivity = sensitivities(frequency, float(ours))[:, np.newaxis, np.newaxis]
    differences = np.abs(test / theirs - reference / ours) * sensitivity
    mean = raised(differences, PIXEL_EXPONENT).mean(axis=(1, 2))
    weights = STILL_WEIGHT * np.array(BASE_WEIGHTS)[:, np.newaxis, np.newaxis]
    strength = norm(differences * weights, CHANNEL_EXPONENT, axis=0)
    return raised(mean, 1 / PIXEL_EXPONENT), np.asarray(strength, np.float32)


def _reconstructed(maps: list[Plane]) -> Plane:
    """Return the sum of the expanded maps, as a share of the scale."""
    total = maps[-1]
    for finer in reversed(maps[:-1]):
        total = expanded(total, finer.shape) + finer
    return np.asarray(1 - jod(np.maximum(total, 0)) / 10, np.float32)
