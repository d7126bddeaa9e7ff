"""The eye's sensitivity: contrast, luminance and masking, one function for each quantity.

Every function broadcasts as numpy does and computes in float32, like the metric's goldens. NaN and
negative arguments, for which no function is defined, give NaN.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Array: TypeAlias = NDArray[np.float32]

#: The frequency at which sensitivity peaks at 100 cd/m², in cycles per degree.
PEAK_FREQUENCY_CPD = 3.248
#: The luminance at which the bands are weighted, in cd/m².
PEAK_LUMINANCE = 100.0

#: Barten: a = A_SCALE (1 + A_LUMINANCE/L)^A_POWER, and b likewise; the rest is RISE.
A_SCALE, A_LUMINANCE, A_POWER = 440.0, 0.7, -0.2
B_SCALE, B_LUMINANCE, B_POWER = 0.3, 100.0, 0.15
RISE = 0.06

#: Ward Larson: where one piece gives way to the next, in log10 cd/m².
ROD_CURVE_FROM, ROD_LINE_FROM, CONE_CURVE_FROM, CONE_LINE_FROM = -3.94, -1.44, -0.0184, 1.9
#: The pieces, log10 of the threshold at g: the constant, (slope g + intercept)^power + offset for
#: the curves, and g + offset for the lines.
ROD_CONSTANT = -2.86
ROD_CURVE = (0.405, 1.6, 2.18, -2.86)
ROD_LINE = -0.395
CONE_CURVE = (0.249, 0.65, 2.7, -0.72)
CONE_LINE = -1.255

#: Daly: (1 + (MASKING_SCALE (MASKING_CONTRAST x)^MASKING_POWER)^4)^(1/4).
MASKING_SCALE, MASKING_CONTRAST, MASKING_POWER = 0.0153, 392.498, 0.7


def contrast_sensitivity(frequency_cpd: ArrayLike, luminance: ArrayLike) -> Array:
    """Return the contrast sensitivity, the inverse of the smallest visible contrast.

    Parameters
    ----------
    frequency_cpd
        Spatial frequency in cycles per degree, 0 or more.
    luminance
        Adaptation luminance in cd/m², 0 or more.

    Returns
    -------
    Array
        Sensitivity, dimensionless, 0 or more; 0 in the dark and at infinite frequency.

    Notes
    -----
    With a = 440 (1 + 0.7/L)^-0.2 and b = 0.3 (1 + 100/L)^0.15, the sensitivity is
    a c e^(-bc) sqrt(1 + 0.06 e^(bc)). The code computes the equal a c sqrt(q² + 0.06 q) with
    q = e^(-bc), which does not overflow at high frequencies.

    References
    ----------
    P. G. J. Barten, The square root integral (SQRI): a new metric to describe the effect of various
    display parameters on perceived image quality, Proc. SPIE 1077, 1989. doi:10.1117/12.952705

    Examples
    --------
    >>> round(float(contrast_sensitivity(3.248, 100)), 2)
    525.15
    >>> contrast_sensitivity([1, 4, 16], 10).round().tolist()
    [295.0, 359.0, 55.0]
    """
    frequency = np.asarray(frequency_cpd, dtype=np.float32)
    light = np.asarray(luminance, dtype=np.float32)
    # At L = 0 both quotients are infinite, so a = 0. The limit is 0 wherever a factor is 0.
    with np.errstate(divide="ignore", over="ignore", under="ignore", invalid="ignore"):
        scale = A_SCALE * np.power(1 + np.float32(A_LUMINANCE) / light, np.float32(A_POWER))
        slope = B_SCALE * np.power(1 + np.float32(B_LUMINANCE) / light, np.float32(B_POWER))
        decay = np.exp(-slope * frequency)
        rise = scale * frequency
        fall = np.sqrt(decay * (decay + np.float32(RISE)))
        sensitivity: Array = np.where((rise == 0) | (fall == 0), np.float32(0), rise * fall)
    undefined = (frequency < 0) | (light < 0)
    sensitivity[undefined] = np.nan
    return sensitivity


def luminance_threshold(adaptation_luminance: ArrayLike) -> Array:
    """Return the smallest visible difference in luminance (threshold versus intensity), in cd/m².

    Parameters
    ----------
    adaptation_luminance
        Luminance to which the eye is adapted in cd/m², 0 or more.

    Returns
    -------
    Array
        Threshold in cd/m²; 10^-2.86 in full darkness, and about 5.6 % of the luminance in daylight.

    Notes
    -----
    Five pieces in log10 of the luminance, rods below about 0.04 cd/m² and cones above. The printed
    pieces do not quite meet: the largest jump is 0.013 in log10, at -1.44.

    References
    ----------
    G. Ward Larson, H. Rushmeier and C. Piatko, A visibility matching tone reproduction operator for
    high dynamic range scenes, IEEE TVCG 3(4), 1997. doi:10.1109/2945.646233

    Examples
    --------
    >>> [round(float(v), 4) for v in luminance_threshold([0, 1, 100])]
    [0.0014, 0.3913, 5.559]
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        log_light = np.log10(np.asarray(adaptation_luminance, dtype=np.float32))
    log_threshold = np.piecewise(
        log_light,
        [
            log_light < ROD_CURVE_FROM,
            (log_light >= ROD_CURVE_FROM) & (log_light < ROD_LINE_FROM),
            (log_light >= ROD_LINE_FROM) & (log_light < CONE_CURVE_FROM),
            (log_light >= CONE_CURVE_FROM) & (log_light < CONE_LINE_FROM),
        ],
        [
            ROD_CONSTANT,
            lambda g: _curve(g, *ROD_CURVE),
            lambda g: g + ROD_LINE,
            lambda g: _curve(g, *CONE_CURVE),
            lambda g: g + CONE_LINE,  # and NaN, which no comparison catches
        ],
    )
    threshold: Array = np.power(np.float32(10), log_threshold)
    return threshold


def masking(normalised_contrast: ArrayLike) -> Array:
    """Return the factor by which a pattern raises the threshold for differences on it.

    Parameters
    ----------
    normalised_contrast
        The pattern's contrast times the contrast sensitivity, dimensionless, 0 or more.

    Returns
    -------
    Array
        Threshold elevation: 1 without a pattern, and as its contrast to the power 0.7 if strong.

    References
    ----------
    S. Daly, Visible differences predictor: an algorithm for the assessment of image fidelity,
    Proc. SPIE 1666, 1992. doi:10.1117/12.135952

    Examples
    --------
    >>> [round(float(v), 3) for v in masking([0, 1, 10])]
    [1.0, 1.19, 5.018]
    """
    contrast = np.asarray(normalised_contrast, dtype=np.float32)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        raised = np.float32(MASKING_SCALE) * np.power(
            np.float32(MASKING_CONTRAST) * contrast, np.float32(MASKING_POWER)
        )
        squared = raised * raised
        # Two square roots are several times as fast as a fourth root by a power.
        elevation: Array = np.sqrt(np.sqrt(1 + squared * squared))
    return elevation


def _curve(log_light: Array, slope: float, intercept: float, power: float, offset: float) -> Array:
    """Return a curved piece of the luminance threshold in log10 cd/m²."""
    raised: Array = np.power(slope * log_light + intercept, np.float32(power)) + offset
    return raised
