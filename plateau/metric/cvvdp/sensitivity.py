"""castleCSF: the contrast sensitivity of each channel, from the authors' table.

The table, ``castle_csf.json``, has log10 of the sensitivity to a pattern in a Gaussian envelope of
fixed size at 32 luminances and 32 frequencies, rounded to seven digits. The pattern is static, and
flickers at 5 Hz for the transient channel.
"""

import json
from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from plateau.metric.cvvdp.parameters import CHANNELS, SENSITIVITY_DB


@cache
def _table() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    text = files("plateau.metric.cvvdp").joinpath("castle_csf.json").read_text(encoding="utf-8")
    parts = json.loads(text)
    luminance, frequency = (np.log10(parts[name]) for name in ("luminance", "frequency"))
    return luminance, frequency, np.array(parts["log10_sensitivity"])


def log_luminances() -> tuple[float, float]:
    """Return log2 of the least and the greatest luminance of the table, in cd/m².

    Examples
    --------
    >>> [round(2**bound, 3) for bound in log_luminances()]
    [0.005, 10000.0]
    """
    luminance, _, _ = _table()
    return float(luminance[0] / np.log10(2)), float(luminance[-1] / np.log10(2))


def log_sensitivities(frequency_cpd: float) -> NDArray[np.float32]:
    """Return log2 of the sensitivities at this frequency, (channels, luminances).

    Luminances are evenly spaced in their logarithm between those of `log_luminances`.

    Parameters
    ----------
    frequency_cpd
        Spatial frequency in cycles per degree, above 0.

    Notes
    -----
    Linear between the table's points in log frequency, and on along the last piece beyond them;
    the correction is 10^(-0.28/20).

    Examples
    --------
    >>> log_sensitivities(2.0).shape
    (4, 32)
    """
    _, frequency, log_sensitivity = _table()
    x = np.log10(frequency_cpd)
    i = int(np.clip(np.searchsorted(frequency, x) - 1, 0, frequency.size - 2))
    share = (x - frequency[i]) / (frequency[i + 1] - frequency[i])
    low, high = log_sensitivity[..., i], log_sensitivity[..., i + 1]
    found = low + share * (high - low) + SENSITIVITY_DB / 20
    return np.asarray(found / np.log10(2), np.float32)


def sensitivities(frequency_cpd: float, luminance: float) -> NDArray[np.float64]:
    """Return each channel's contrast sensitivity, (channels,).

    Parameters
    ----------
    frequency_cpd
        Spatial frequency in cycles per degree, above 0.
    luminance
        Background luminance in cd/m², above 0.

    Examples
    --------
    >>> sensitivities(2.0, 100.0).round(1).tolist()
    [279.0, 284.8, 61.7, 301.7]
    """
    table = log_sensitivities(frequency_cpd)
    points = np.linspace(*log_luminances(), table.shape[1])
    return np.array([2 ** np.interp(np.log2(luminance), points, table[c]) for c in range(CHANNELS)])
