"""The display on which two images are compared: how bright, how dark, and how far away."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from plateau.bounds import bounded, require_bounds
from plateau.metric.cvvdp.parameters import LMS_TO_DKL, XYZ_TO_LMS

#: What pixels are: code values in [0, 1], or linear light of which 1 is the peak.
Transfer = Literal["srgb", "relative"]
Primaries = Literal["rec709", "adobe1998", "rec2020"]

_RGB_TO_XYZ = {
    "rec709": [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.072175],
        [0.0193339, 0.119192, 0.9503041],
    ],
    "adobe1998": [
        [0.5766690, 0.1855582, 0.1882286],
        [0.2973450, 0.6273636, 0.0752915],
        [0.0270314, 0.0706889, 0.9913375],
    ],
    "rec2020": [[0.637, 0.1446, 0.1689], [0.2627, 0.678, 0.0593], [0.0, 0.0281, 1.061]],
}


@dataclass(frozen=True)
class Display:
    """A screen, the room, and the distance from which it is seen.

    Raises
    ------
    ValueError
        If a number is outside its domain.

    Examples
    --------
    >>> round(DISPLAYS["standard_4k"].pixels_per_degree, 1)
    75.4
    >>> round(Display(ambient_lux=250).reflected, 3)
    0.398
    """

    #: Pixels in a degree of visual angle at the screen's centre, above 0.
    pixels_per_degree: float = bounded(75.4, 0.1, 1000.0)
    #: Luminance of white, and of black in a dark room, in cd/m²: 0 ≤ black < peak.
    peak: float = bounded(200.0, 0.01, 20_000.0)
    black: float = bounded(0.2, 0.0, 20_000.0)
    #: Light on the screen, in lux, 0 or more.
    ambient_lux: float = bounded(250.0, 0.0, 1e6)
    #: The share of it that the screen reflects, in [0, 1].
    reflectivity: float = bounded(0.005, 0.0, 1.0)
    transfer: Transfer = "srgb"
    primaries: Primaries = "rec709"
    #: By what linear light is multiplied before the screen clips it, above 0.
    exposure: float = bounded(1.0, 1e-9, 1e9)

    def __post_init__(self) -> None:
        require_bounds(self)
        if self.black >= self.peak:
            raise ValueError(f"black must be below the peak of {self.peak} cd/m², not {self.black}")
        for name, choice, choices in (
            ("transfer", self.transfer, get_args(Transfer)),
            ("primaries", self.primaries, get_args(Primaries)),
        ):
            if choice not in choices:
                raise ValueError(f"a display's {name} is one of {', '.join(choices)}, not {choice}")

    @property
    def reflected(self) -> float:
        """The ambient light that the screen reflects, in cd/m²: E k / π."""
        return self.ambient_lux / math.pi * self.reflectivity

    @property
    def rgb_to_dkl(self) -> NDArray[np.float32]:
        """The matrix from emitted RGB to opponent colour (achromatic, RG, YV), (3, 3)."""
        matrix: NDArray[np.float32] = np.asarray(
            LMS_TO_DKL @ XYZ_TO_LMS @ np.array(_RGB_TO_XYZ[self.primaries]), np.float32
        )
        return matrix


def pixels_per_degree(
    resolution: tuple[int, int], diagonal_inches: float, distance_m: float
) -> float:
    """Return the pixels in a degree at the centre of a flat screen with square pixels.

    Parameters
    ----------
    resolution
        Width and height in pixels.
    diagonal_inches
        The screen's diagonal.
    distance_m
        From the eye to the screen, in metres.

    Notes
    -----
    1 / (2 atan(w / 2 d)) per radian, with the width w of a pixel and the distance d.

    Examples
    --------
    >>> round(pixels_per_degree((1920, 1080), 24, 0.6), 2)
    37.84
    """
    pixel_m = diagonal_inches * 0.0254 / math.hypot(*resolution)
    return 1 / math.degrees(2 * math.atan(pixel_m / (2 * distance_m)))


#: Standard displays of the authors: two desks, and a phone.
DISPLAYS: Mapping[str, Display] = MappingProxyType(
    {
        "standard_4k": Display(pixels_per_degree((3840, 2160), 30, 0.7472)),
        "standard_fhd": Display(pixels_per_degree((1920, 1080), 24, 0.6)),
        "standard_phone": Display(pixels_per_degree((2400, 1080), 6, 0.4), 500, 0.05),
    }
)
