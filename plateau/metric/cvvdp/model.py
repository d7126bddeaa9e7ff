"""`ColorVideoVDP`: two images or videos on a display, and the quality of one against the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from plateau.metric.cvvdp.bands import contrasts, masked, powers_by_zone
from plateau.metric.cvvdp.light import screen
from plateau.metric.cvvdp.parameters import (
    BASE_WEIGHTS,
    CHANNEL_EXPONENT,
    CHANNEL_WEIGHTS,
    COLOURS,
    LEAST_BACKGROUND,
    PIXEL_EXPONENT,
)
from plateau.metric.cvvdp.percept import Percept, checked, percept_of, write_colours
from plateau.metric.cvvdp.pooling import (
    jod,
    norm,
    over_frames,
    pooled_difference,
    raised,
    shares_by_zone,
    viewing_weight,
)
from plateau.metric.cvvdp.pyramid import band_frequencies, expanded
from plateau.metric.cvvdp.sensitivity import log_sensitivities, sensitivities
from plateau.metric.cvvdp.video import Video
from plateau.metric.display import require_same_size
from plateau.metric.rows import by_rows

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from plateau.metric.cvvdp.display import Display
    from plateau.metric.display import Plane


@dataclass(frozen=True, eq=False)
class Quality:
    """How a test image, or a frame of a video, compares with a reference."""

    #: 10 where nobody sees a difference; one less where three of four prefer the reference. Of a
    #: frame it is what the video would have if all its frames differed as much.
    jod: float
    #: What each channel and band contributes, (channels, bands), from the finest band to the base.
    #: A still has three channels, a frame also the transient one.
    differences: NDArray[np.float64]
    #: Where a person would see it, (H, W) float32 of 0 or more: what is lost, over 10 JOD; or None.
    heat: Plane | None
    #: What each zone has of the pooled difference, (2, rows, columns), or None: `shares_by_zone`.
    zones: NDArray[np.float64] | None = None


class ColorVideoVDP:
    """The model for one display.

    Parameters
    ----------
    display
        The screen, the room and the distance.

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

    def __init__(self, display: Display) -> None:
        self.display = display
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
            If the image is not (H, W, 3), too small, not finite, or has code values outside [0, 1].
        """
        image = checked(image, self.display)
        colours = np.empty((COLOURS, *image.shape[:2]), np.float32)
        write_colours(image, self._screen, colours)
        return percept_of(colours, self.display)

    def video(self, fps: float) -> Video:
        """Return a video without frames, from 1 to 480 per second, whose percepts `compare` takes.

        Each video has its own, the reference and the test.

        Examples
        --------
        >>> from plateau.metric.cvvdp import DISPLAYS, video_jod
        >>> model = ColorVideoVDP(DISPLAYS["standard_fhd"])
        >>> noise = np.random.default_rng(1).random((6, 64, 64, 3), np.float32) / 5
        >>> still, flickering = model.video(24), model.video(24)
        >>> frames = [
        ...     model.compare(still.percept(noise[0]), flickering.percept(frame)) for frame in noise
        ... ]
        >>> frames[0].jod, video_jod(frames) < 9
        (10.0, True)
        """
        return Video(self.display, fps)

    def compare(
        self,
        reference: Percept,
        test: Percept,
        *,
        heat: bool = False,
        zone_size: int | None = None,
    ) -> Quality:
        """Return the quality of the test image, with a heat map if asked.

        The comparison is not symmetric: the eye is adapted to the reference. With `zone_size` it
        has the share of each zone too, a square of so many pixels; the last ones may be smaller.

        Raises
        ------
        ValueError
            If the images differ in size, or were prepared for another display or frame rate.
        """
        require_same_size(reference.shape, test.shape)
        for percept in (reference, test):
            if percept.display != self.display:
                raise ValueError(f"an image prepared for {percept.display} met {self.display}")
        if reference.fps != test.fps:
            ours, theirs = (
                f"a frame at {percept.fps:g} fps" if percept.fps else "a still"
                for percept in (reference, test)
            )
            raise ValueError(f"{ours} as the reference met {theirs}")
        frequencies = band_frequencies(reference.shape, self.display.pixels_per_degree)
        pooled, maps, zones = [], [], []
        for band, frequency in enumerate(frequencies[:-1]):
            each, sums, strength = self._band(reference, test, band, frequency, heat)
            pooled.append(sums)
            maps.append(strength)
            if zone_size is not None:
                zones.append(_by_zone(each, band, reference.shape, zone_size))
        sums, strength = _base(reference.levels[-1], test.levels[-1], frequencies[-1])
        differences = np.stack([*pooled, sums], axis=1)
        heat_map = _reconstructed([*maps, strength]) if heat else None
        shares = shares_by_zone(np.stack(zones, axis=1)) if zones else None
        return Quality(float(jod(pooled_difference(differences))), differences, heat_map, shares)

    def _band(
        self, reference: Percept, test: Percept, band: int, frequency: float, heat: bool
    ) -> tuple[Plane, NDArray[np.float64], Plane]:
        """Return each channel's differences in a band, them pooled, and the map."""
        ours, our_next = reference.levels[band : band + 2]
        theirs, their_next = test.levels[band : band + 2]
        channels, height, width = ours.shape
        # A band's kernel lets half of its contrast through, except for the finest.
        scale = np.float32(1 if band == 0 else 2)
        table = log_sensitivities(frequency)
        differences, common = np.empty_like(ours), np.empty_like(ours)
        by_rows(
            *(contrasts, ours.shape, ours, our_next, theirs, their_next),
            *(table, scale, differences, common),
        )
        sums, weights = np.empty((channels, height)), _weights(channels)
        strength = np.empty((height, width) if heat else (0, 0), np.float32)
        by_rows(masked, ours.shape, differences, common, weights, sums, strength)
        mean = sums.sum(axis=1) / (height * width)
        if heat and band > 0:
            strength *= np.float32(0.5)
        return differences, raised(mean, 1 / PIXEL_EXPONENT), strength


def video_jod(frames: Iterable[Quality]) -> float:
    """Return the JOD of a video from the qualities of all its frames.

    Frames are pooled by their quadratic mean. The authors judge a video of one frame as a still.

    Raises
    ------
    ValueError
        If there are no frames.

    Examples
    --------
    >>> frames = [Quality(10.0, np.full((4, 6), q), None) for q in (0.0, 1.0)]
    >>> round(video_jod(frames), 3)
    9.476
    """
    differences = [pooled_difference(frame.differences) for frame in frames]
    if not differences:
        raise ValueError("a video without frames has no quality")
    return float(jod(over_frames(differences)))


def _weights(channels: int) -> NDArray[np.float32]:
    """Return by what the differences of each channel count in the map."""
    weights = viewing_weight(channels) * np.array(CHANNEL_WEIGHTS[:channels])
    return weights.astype(np.float32)


def _by_zone(
    differences: Plane, band: int, shape: tuple[int, int], size: int
) -> NDArray[np.float64]:
    """Return the sums of D² and D³ over each zone, over the pixels of the band."""
    channels, height, width = differences.shape
    rows, columns = (-(-pixels // size) for pixels in shape)
    sums = np.zeros((channels, rows, columns, 2))
    powers_by_zone(differences, 2**band, size, sums)
    sums /= height * width
    return sums


def _base(reference: Plane, test: Plane, frequency: float) -> tuple[NDArray[np.float64], Plane]:
    """Return each channel's pooled difference in the base band, and its map.

    D = S |test / mean(test) - reference / mean(reference)|, with the means of luminance.
    """
    ours, theirs = (np.maximum(level[0], LEAST_BACKGROUND).mean() for level in (reference, test))
    channels = len(reference)
    sensitivity = sensitivities(frequency, float(ours))[:channels, np.newaxis, np.newaxis]
    differences = np.abs(test / theirs - reference / ours) * sensitivity
    mean = raised(differences, PIXEL_EXPONENT).mean(axis=(1, 2))
    weights = _weights(channels) * np.array(BASE_WEIGHTS[:channels])
    strength = norm(differences * weights[:, np.newaxis, np.newaxis], CHANNEL_EXPONENT, axis=0)
    return raised(mean, 1 / PIXEL_EXPONENT), np.asarray(strength, np.float32)


def _reconstructed(maps: list[Plane]) -> Plane:
    """Return the sum of the expanded maps, as a share of the scale."""
    total = maps[-1]
    for finer in reversed(maps[:-1]):
        total = expanded(total, finer.shape) + finer
    shares = np.empty(total.shape, np.float32)

    def write(first: int, last: int) -> None:
        shares[first:last] = 1 - jod(np.maximum(total[first:last], 0)) / 10

    by_rows(write, shares.shape)
    return shares
