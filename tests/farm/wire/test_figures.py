"""Figures in words."""

import pytest

from plateau.farm.wire.figures import duration, percent, pixels, roughly, share, significant


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (0, "0.0 s"),
        (4.23, "4.2 s"),
        (59.94, "59.9 s"),
        (59.96, "1 min 0 s"),
        (200, "3 min 20 s"),
        (3599.6, "1 h 00 min"),
        (7500, "2 h 05 min"),
    ],
)
def test_durations(seconds: float, words: str) -> None:
    assert duration(seconds) == words


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0, "5 s"), (12.5, "15 s"), (118, "120 s"), (125, "2 min"), (5399, "90 min"), (9000, "2.5 h")],
)
def test_durations_that_are_only_expected(seconds: float, words: str) -> None:
    assert roughly(seconds) == words


@pytest.mark.parametrize(
    ("fraction", "words"),
    [
        (0, "0 %"),
        (0.9, "90 %"),
        (0.29, "29 %"),  # 0.29 * 1000 is a little less than 290
        (0.125, "12.5 %"),
        (0.9999, "99.9 %"),
        (1, "100 %"),
    ],
)
def test_shares_of_a_cap_are_never_rounded_up(fraction: float, words: str) -> None:
    assert share(fraction) == words


@pytest.mark.parametrize(
    ("fraction", "words"),
    [
        (0, "0 %"),
        (1e-7, "0.00001 %"),
        (0.000113, "0.011 %"),
        (0.0125, "1.3 %"),
        (0.12345, "12.3 %"),
        (1, "100 %"),
    ],
)
def test_fractions(fraction: float, words: str) -> None:
    assert percent(fraction) == words


@pytest.mark.parametrize(
    ("count", "words"),
    [(0, "0"), (0.5, "0.5"), (9.96, "10"), (12.5, "13"), (232.5, "233"), (1234567, "1,234,567")],
)
def test_numbers_of_pixels(count: float, words: str) -> None:
    assert pixels(count) == words


@pytest.mark.parametrize(
    ("number", "words"),
    [(0, "0"), (-0.25, "-0.25"), (1234.5, "1,235"), (0.000012345, "0.0000123"), (99.96, "100")],
)
def test_digits_that_count(number: float, words: str) -> None:
    assert significant(number) == words
