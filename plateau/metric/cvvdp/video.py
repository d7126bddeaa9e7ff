"""A video on one display: the frames that the eye still sees, in its four temporal channels.

The eye's response to frame f is a weighted sum of the last quarter of a second, up to f itself;
before the first frame stands the first frame, unless others are given before it (`mirrored`). Its
filters are even functions around the middle of that time, so they answer an eighth of a second
late, to both videos alike. The opponent colours pass three low-pass filters, and the achromatic
one, also a band-pass filter at 5 Hz: the transient channel, in which flicker is seen.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from plateau.metric.compiled.jit import entry_point
from plateau.metric.cvvdp.bands import add_scaled
from plateau.metric.cvvdp.light import screen
from plateau.metric.cvvdp.parameters import (
    CHANNELS,
    COLOURS,
    FILTER_S,
    TEMPORAL_EXPONENTS,
    TEMPORAL_SPREADS,
    TRANSIENT_PEAK_HZ,
)
from plateau.metric.cvvdp.percept import Percept, checked, percept_of, write_colours

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.metric.cvvdp.display import Display
    from plateau.metric.display import Plane

#: Frames per second of a video.
LEAST_FPS, MOST_FPS = 1.0, 480.0


class Video:
    """The frames of one video, given one after another; made by `ColorVideoVDP.video`.

    It holds the opponent colours of the last quarter of a second, 12 bytes a pixel and frame.

    Parameters
    ----------
    display
        The screen, the room and the distance.
    fps
        Frames per second, from 1 to 480.

    Raises
    ------
    ValueError
        If the frames per second are out of range.

    Examples
    --------
    >>> from plateau.metric.cvvdp import DISPLAYS
    >>> video = Video(DISPLAYS["standard_fhd"], 24)
    >>> grey = np.full((64, 64, 3), 0.5, np.float32)
    >>> video.percept(grey).levels[0].shape
    (4, 64, 64)
    """

    def __init__(self, display: Display, fps: float) -> None:
        self.display = display
        self.fps = fps
        self._taps = temporal_filters(fps)
        self._screen = screen(display)
        self._frames = 0
        self._window = np.empty((0, COLOURS, 0, 0), np.float32)

    def percept(self, image: NDArray[Any]) -> Percept:
        """Return what the eye has of the next frame.

        Parameters
        ----------
        image
            (H, W, 3), of any real dtype, in the display's transfer, of the size of the first frame.

        Raises
        ------
        ValueError
            As `ColorVideoVDP.percept`, and if the frame differs in size from the first.
        """
        image = checked(image, self.display)
        _, length = self._taps.shape
        height, width, _ = image.shape
        if self._frames == 0:
            self._window = np.empty((length, COLOURS, height, width), np.float32)
        elif self._window.shape[2:] != (height, width):
            first_height, first_width = self._window.shape[2:]
            raise ValueError(
                f"frame {self._frames} of a video has {width}×{height} pixels, "
                f"the first {first_width}×{first_height}"
            )
        colours = self._window[self._frames % length]
        write_colours(image, self._screen, colours)
        shown = np.arange(self._frames - length + 1, self._frames + 1).clip(0) % length
        self._frames += 1
        channels = np.empty((CHANNELS, height, width), np.float32)
        _filter(self._window, shown, self._taps, channels)
        return percept_of(channels, self.display, self.fps)


def mirrored(fps: float, frames: int) -> list[int]:
    """Return which frames of a video to give before its first, so that it begins as it goes on.

    They are those that follow the first one, the nearest last. Their own quality does not count.
    Without them the first frame, noise included, stands still for a quarter of a second.

    Parameters
    ----------
    fps
        Frames per second, from 1 to 480.
    frames
        How many frames the video has, 1 or more.

    Examples
    --------
    >>> mirrored(24, 48)
    [6, 5, 4, 3, 2, 1]
    >>> mirrored(24, 3)
    [2, 1, 0, 1, 2, 1]
    """
    _, length = temporal_filters(fps).shape
    period = max(2 * (frames - 1), 1)
    places = (before % period for before in range(length - 1, 0, -1))
    return [min(place, period - place) for place in places]


def temporal_filters(fps: float) -> NDArray[np.float32]:
    """Return the weights of the frames of a quarter of a second, (channels, frames), oldest first.

    Parameters
    ----------
    fps
        Frames per second, from 1 to 480.

    Notes
    -----
    The responses exp(-ω^b / s) of the sustained channels, and exp(-(ω^b - 5^b)² / s) of the
    transient one, sampled from 0 to fps / 2 Hz and transformed.

    Examples
    --------
    >>> temporal_filters(24).shape, temporal_filters(60).shape
    ((4, 7), (4, 17))
    >>> temporal_filters(24).sum(axis=1).round(3).tolist()
    [1.0, 1.0, 1.0, 0.0]
    """
    if not LEAST_FPS <= fps <= MOST_FPS:
        raise ValueError(f"fps must be a number from {LEAST_FPS:g} to {MOST_FPS:g}, not {fps!r}")
    length = 2 * math.ceil(FILTER_S * fps / 2) + 1
    hz = np.linspace(0, fps / 2, length // 2 + 1)
    exponents = np.array(TEMPORAL_EXPONENTS)
    powers = hz ** exponents[:, np.newaxis]
    powers[COLOURS] = (powers[COLOURS] - TRANSIENT_PEAK_HZ ** exponents[COLOURS]) ** 2
    responses = np.exp(-powers / np.array(TEMPORAL_SPREADS)[:, np.newaxis])
    return np.fft.fftshift(np.fft.irfft(responses, length), axes=1).astype(np.float32)


@entry_point
def _filter(window: NDArray[np.float32], shown: NDArray[np.int64], taps: Plane, out: Plane) -> None:
    """Write the channels, (4, H, W), of the frames of the window that are shown."""
    for y in range(out.shape[1]):
        for channel in range(CHANNELS):
            colour = channel % COLOURS  # the transient channel is achromatic
            row = out[channel, y]
            row[:] = 0
            for k in range(shown.size):
                add_scaled(window[shown[k], colour, y], taps[channel, k], row)
