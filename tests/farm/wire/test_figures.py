"""Figures in words."""

from collections.abc import Callable

import pytest

from plateau.farm.wire.figures import duration, percent, pixels, roughly, share, significant


@pytest.mark.parametrize(
    ("say", "number", "words"),
    [
        (duration, 0, "0.0 s"),
        (duration, 4.23, "4.2 s"),
        (duration, 59.94, "59.9 s"),
        (duration, 59.96, "1 min 0 s"),
        (duration, 200, "3 min 20 s"),
        (duration, 3599.6, "1 h 00 min"),
        (duration, 7500, "2 h 05 min"),
        # A duration that is only expected
        (roughly, 0, "5 s"),
        (roughly, 12.5, "15 s"),
        (roughly, 118, "120 s"),
        (roughly, 125, "2 min"),
        (roughly, 5399, "90 min"),
        (roughly, 9000, "2.5 h"),
        # A share of a cap is never rounded up; 0.29 * 1000 is a little less than 290
        (share, 0, "0 %"),
        (share, 0.9, "90 %"),
        (share, 0.29, "29 %"),
        (share, 0.125, "12.5 %"),
        (share, 0.9999, "99.9 %"),
        (share, 1, "100 %"),
        (percent, 0, "0 %"),
        (percent, 1e-7, "0.00001 %"),
        (percent, 0.000113, "0.011 %"),
        (percent, 0.0125, "1.3 %"),
        (percent, 0.12345, "12.3 %"),
        (percent, 1, "100 %"),
        (pixels, 0, "0"),
        (pixels, 0.5, "0.5"),
        (pixels, 9.96, "10"),
        (pixels, 12.5, "13"),
        (pixels, 232.5, "233"),
        (pixels, 1234567, "1,234,567"),
        (significant, 0, "0"),
        (significant, -0.25, "-0.25"),
        (significant, 1234.5, "1,235"),
        (significant, 0.000012345, "0.0000123"),
        (significant, 99.96, "100"),
    ],
)
def test_a_figure_is_said_in_words(say: Callable[[float], str], number: float, words: str) -> None:
    assert say(number) == words
