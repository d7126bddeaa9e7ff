"""Figures in words, for command line, report and pictures alike.

The page has the same (``plateau/service/page/shared/figures.js``), and a test compares the two.
"""

from decimal import ROUND_HALF_UP, Decimal
from typing import Final

_MINUTE_S: Final = 60
_HOUR_S: Final = 3600


def duration(seconds: float) -> str:
    """Seconds as people say them: ``4.2 s``, ``3 min 20 s``, ``2 h 05 min``."""
    if seconds < _MINUTE_S - 0.05:
        return f"{_rounded(seconds, -1)} s"
    whole = int(_rounded(seconds, 0))
    if whole < _HOUR_S:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


def roughly(seconds: float) -> str:
    """A duration that is only expected: to five seconds below two minutes, then to the minute."""
    if seconds < 2 * _MINUTE_S:
        return f"{max(5, 5 * int(_rounded(seconds / 5, 0)))} s"
    if seconds < 1.5 * _HOUR_S:
        return f"{_rounded(seconds / _MINUTE_S, 0)} min"
    return f"{significant(seconds / _HOUR_S, 2)} h"


def share(fraction: float) -> str:
    """A share of a cap as a percentage, rounded down: 100 means the whole."""
    tenths = int(fraction * 1000 + 1e-9)
    return f"{tenths // 10} %" if tenths % 10 == 0 else f"{tenths / 10:.1f} %"


def percent(fraction: float) -> str:
    """A fraction as a percentage, with three digits from 10 % on and two below.

    Examples
    --------
    >>> percent(0.0363), percent(0.000113), percent(0.1251)
    ('3.6 %', '0.011 %', '12.5 %')
    """
    return f"{significant(100 * fraction, 3 if fraction >= 0.1 else 2)} %"


def spp_range(least: int | None, most: int | None) -> str:
    """The samples per pixel of the zone with the fewest and of that with the most; "" if alike.

    Examples
    --------
    >>> spp_range(500, 1400), spp_range(80, 80), spp_range(None, None)
    ('500 to 1,400 spp', '', '')
    """
    return "" if least is None or most is None or least == most else f"{least:,} to {most:,} spp"


def pixels(count: float) -> str:
    """A number of pixels: whole ones, or two digits below ten.

    The noise left is the mean of two counts, and may be half a pixel.

    Examples
    --------
    >>> pixels(1234), pixels(232.5), pixels(0.5)
    ('1,234', '233', '0.5')
    """
    return f"{_rounded(count, 0):,}" if count >= 10 else significant(count, 2)


def significant(number: float, digits: int = 3) -> str:
    """A number with this many significant digits, or all digits before the point; never ``1e-05``.

    Examples
    --------
    >>> significant(0.48211), significant(1234.5), significant(2.0)
    ('0.482', '1,235', '2')
    """
    if number == 0:
        return "0"
    text = f"{_rounded(number, min(0, Decimal(number).adjusted() - digits + 1)):,f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def _rounded(number: float, exponent: int) -> Decimal:
    """Rounded to a power of ten; halves go up, as in browsers and not in Python."""
    return Decimal(number).quantize(Decimal(1).scaleb(exponent), ROUND_HALF_UP)
