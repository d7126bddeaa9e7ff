"""The display model in front of the metric: from an image to the light of a screen.

An image is an ``(H, W, 3)`` float32 array of linear radiance (or of code values if the view has a
gamma). The functions compute, for a `View`, the displayed RGB, CIE XYZ, luminance, and the CIELAB
coordinates a* and b*.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from plateau.bounds import bounded, bounded_if_given, require_bounds

#: An image, (H, W, 3) float32.
Image: TypeAlias = NDArray[np.float32]
#: One number for each pixel, (H, W) float32, or a stack of such planes, (N, H, W).
Plane: TypeAlias = NDArray[np.float32]
#: True or false for each pixel, (H, W).
Mask: TypeAlias = NDArray[np.bool_]

Primaries = Literal["rec709", "adobe1998"]

#: Linear RGB to CIE XYZ under D65, one row each for X, Y and Z.
RGB_TO_XYZ: Mapping[Primaries, NDArray[np.float32]] = MappingProxyType(
    {
        # ITU-R BT.709 and IEC 61966-2-1 (sRGB) share these.
        "rec709": np.array(
            [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]],
            dtype=np.float32,
        ),
        # Adobe RGB (1998) with the digits of Yee's program, so that counts can be compared.
        "adobe1998": np.array(
            [
                [0.576700, 0.185556, 0.188212],
                [0.297361, 0.627355, 0.0752847],
                [0.0270328, 0.0706879, 0.991248],
            ],
            dtype=np.float32,
        ),
    }
)

#: Exposures beyond this overflow float32, and black times infinity is NaN.
EXPOSURE_LIMIT_EV = 100

#: Powers of two that a float32 can hold.
FLOAT32_EXPONENTS = (-126, 127)

#: A room under the sun.
BRIGHTEST_ROOM_LUX = 100_000

#: The brightest white of a screen, in cd/m²: twice the highest that any standard encodes.
BRIGHTEST_WHITE = 20_000

#: From 10,000 pixels on a screen 1,000 km away to a screen directly before the eye.
FIELDS_OF_VIEW_DEG = (0.0001, 179.9)

#: A screen whose pixels are ten degrees wide, and one that no eye resolves.
PIXELS_PER_DEGREE = (0.1, 1000.0)

#: CIE 15:2004, where the cube root of CIELAB gives way to a straight line.
LAB_EPSILON = 216 / 24389
LAB_KAPPA = 24389 / 27
#: The straight line is (κ t + LAB_OFFSET) / LAB_SCALE, as L* = LAB_SCALE f(t) - LAB_OFFSET.
LAB_OFFSET, LAB_SCALE = 16, 116
#: a* and b* for a difference of 1 in the responses to X and Y, and to Y and Z.
LAB_A, LAB_B = 500, 200


@dataclass(frozen=True, kw_only=True)
class View:
    """How an image is shown and seen: the screen, and how far away it is.

    By default it is a desk monitor, seen at 200 %, which puts 20 pixels in a degree.

    Raises
    ------
    ValueError
        If a parameter lies outside its domain.
    """

    #: Exposure in stops: displayed light is the image times 2 to this power.
    exposure_ev: float = bounded(0.0, -EXPOSURE_LIMIT_EV, EXPOSURE_LIMIT_EV)
    #: Luminance of the screen's white in cd/m².
    white_luminance: float = bounded(200.0, 0.01, BRIGHTEST_WHITE)
    #: The screen's white over its black in a dark room. This and the light of the room are for
    #: ColorVideoVDP; the model of 2004 knows neither.
    contrast: float = bounded(1000.0, 2.0, 1e9)
    #: Light that falls on the screen, in lux.
    ambient_lux: float = bounded(250.0, 0.0, BRIGHTEST_ROOM_LUX)
    #: Pixels in a degree at the image's centre.
    pixels_per_degree: float = bounded(20.0, *PIXELS_PER_DEGREE)
    #: Horizontal angle that the image fills, in degrees: in place of pixels per degree, if given.
    field_of_view_deg: float | None = bounded_if_given(*FIELDS_OF_VIEW_DEG)
    #: The primaries of the screen and of the image's channels.
    primaries: Primaries = "rec709"
    #: Exponent from the image's values to linear light, above 0: 1 for rendered radiance.
    gamma: float = 1.0
    #: Whether to leave out the chromatic test and judge luminance alone.
    luminance_only: bool = False

    def __post_init__(self) -> None:
        require_bounds(self)
        if self.primaries not in RGB_TO_XYZ:
            known = ", ".join(get_args(Primaries))
            raise ValueError(f"primaries must be one of {known}, not {self.primaries!r}")
        if not (math.isfinite(self.gamma) and self.gamma > 0):
            raise ValueError(f"gamma must be above 0, not {self.gamma}")

    def width_deg(self, width: int) -> float:
        """Return a width in degrees on a flat screen, each as at its centre: 2 tan(a/2) 180/π.

        `width` is that of the image, in pixels. It counts where the view has no field of view.

        Examples
        --------
        >>> round(256 / View(field_of_view_deg=45).width_deg(256), 2)
        5.39
        >>> View(pixels_per_degree=40).width_deg(1920)
        48.0
        """
        if self.field_of_view_deg is None:
            return width / self.pixels_per_degree
        return math.degrees(2 * math.tan(math.radians(self.field_of_view_deg) / 2))

    @property
    def brightest(self) -> float:
        """The image's least value that shows as white.

        Examples
        --------
        >>> View(exposure_ev=1).brightest
        0.5
        """
        least, most = FLOAT32_EXPONENTS
        return float(2.0 ** min(max(-self.exposure_ev / self.gamma, least), most))


def as_image(image: NDArray[Any]) -> Image:
    """Return the array as a float32 image; ValueError if it is not (H, W, 3) or has no pixel."""
    image = np.asarray(image)
    if image.ndim != 3 or image.shape[2] != 3 or image.size == 0:
        raise ValueError(f"an image must have shape (H, W, 3), not {image.shape}")
    return image.astype(np.float32, copy=False)


def require_same_size(reference: tuple[int, int], test: tuple[int, int]) -> None:
    """Raise ValueError unless two images, of these rows and columns, have one size.

    Examples
    --------
    >>> require_same_size((240, 320), (240, 321))
    Traceback (most recent call last):
    ValueError: reference and test must have the same size, not 320×240 and 321×240 pixels
    """
    if reference != test:
        raise ValueError(
            "reference and test must have the same size, not "
            f"{reference[1]}×{reference[0]} and {test[1]}×{test[0]} pixels"
        )


def finite_pixels(image: Image) -> Mask:
    """Return, for each pixel, whether all three channels are finite.

    Examples
    --------
    >>> image = np.zeros((1, 2, 3), np.float32)
    >>> image[0, 1, 2] = np.nan
    >>> finite_pixels(image).tolist()
    [[True, False]]
    """
    red, green, blue = np.moveaxis(image, -1, 0)
    finite: Mask = np.isfinite(red) & np.isfinite(green) & np.isfinite(blue)
    return finite


def displayed(image: Image, view: View) -> Image:
    """Return the linear RGB that the screen shows, (H, W, 3), float32 in [0, 1].

    Values are raised to the view's gamma, scaled by 2^EV and clipped to [0, 1]. Filters with
    negative lobes produce negative values, which show as black.

    Examples
    --------
    >>> image = np.full((1, 1, 3), [-0.5, 0.25, 3.0], np.float32)
    >>> displayed(image, View(exposure_ev=1)).ravel().tolist()
    [0.0, 0.5, 1.0]
    """
    # Planar memory behind the usual shape, because every later step reads one whole channel.
    planes = np.maximum(np.moveaxis(image, -1, 0), np.float32(0), order="C")
    # A value too large for float32 becomes infinite, and the clip makes it white.
    with np.errstate(over="ignore"):
        if view.gamma != 1:
            np.power(planes, np.float32(view.gamma), out=planes)
        if view.exposure_ev != 0:
            np.multiply(planes, np.exp2(np.float32(view.exposure_ev)), out=planes)
    np.minimum(planes, np.float32(1), out=planes)
    return np.moveaxis(planes, 0, -1)


def tristimulus(rgb: Image, primaries: Primaries) -> Plane:
    """Return CIE X, Y and Z of linear RGB, (3, H, W), relative to a white of Y = 1.

    Examples
    --------
    >>> white = np.ones((1, 1, 3), np.float32)
    >>> [round(float(v), 4) for v in tristimulus(white, "rec709").ravel()]
    [0.9505, 1.0, 1.089]
    """
    red, green, blue = np.moveaxis(rgb, -1, 0)
    xyz: Plane = np.empty((3, *red.shape), np.float32)
    term = np.empty_like(red)
    for plane, (r, g, b) in zip(xyz, RGB_TO_XYZ[primaries], strict=True):
        np.multiply(red, r, out=plane)
        plane += np.multiply(green, g, out=term)
        plane += np.multiply(blue, b, out=term)
    return xyz


def opponent_chroma(xyz: Plane, primaries: Primaries) -> Plane:
    """Return CIELAB a* (green to red) and b* (blue to yellow) as (2, H, W), float32.

    The white point is the primaries' own, the matrix applied to (1, 1, 1).

    References
    ----------
    CIE 15:2004, Colorimetry, section 8.2.1.

    Examples
    --------
    >>> red = np.array([1, 0, 0], np.float32).reshape(1, 1, 3)
    >>> a, b = opponent_chroma(tristimulus(red, "rec709"), "rec709")
    >>> round(float(a[0, 0])), round(float(b[0, 0]))
    (80, 67)
    """
    white = RGB_TO_XYZ[primaries].sum(axis=1, dtype=np.float32)
    ratio = xyz / white[:, np.newaxis, np.newaxis]
    # A rounded power instead of the exact cube root, as in the program that made the goldens.
    response = np.power(ratio, np.float32(1 / 3))
    straight = ratio <= LAB_EPSILON
    response[straight] = (LAB_KAPPA * ratio[straight] + LAB_OFFSET) / LAB_SCALE
    chroma: Plane = np.empty((2, *xyz.shape[1:]), np.float32)
    np.subtract(response[0], response[1], out=chroma[0])
    np.subtract(response[1], response[2], out=chroma[1])
    chroma[0] *= LAB_A
    chroma[1] *= LAB_B
    return chroma


def encode_srgb(image: NDArray[Any], exposure_ev: float = 0.0) -> NDArray[np.uint8]:
    """Return a linear Rec. 709 image as 8-bit sRGB for viewing, (H, W, 3) uint8.

    NaN shows as black, infinity as white.

    References
    ----------
    IEC 61966-2-1:1999.

    Examples
    --------
    >>> encode_srgb(np.full((1, 1, 3), 0.214, np.float32)).ravel().tolist()
    [127, 127, 127]
    """
    linear = displayed(as_image(image), View(exposure_ev=exposure_ev))
    linear = np.nan_to_num(linear, copy=False, nan=0.0)
    bytes_: NDArray[np.uint8] = np.rint(srgb_encoded(linear) * 255).astype(np.uint8, order="C")
    return bytes_


def srgb_encoded(linear: Image) -> Image:
    """Return the sRGB values of linear light in [0, 1], (H, W, 3) in [0, 1]."""
    encoded: Image = np.where(
        linear <= 0.0031308, 12.92 * linear, 1.055 * np.power(linear, np.float32(1 / 2.4)) - 0.055
    )
    return encoded
