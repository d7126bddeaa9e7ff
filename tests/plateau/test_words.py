"""Figures in words."""

import pytest

from plateau.words import duration, percent, pixels


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
def test_percentages_are_never_rounded_up(fraction: float, words: str) -> None:
    assert percent(fraction) == words


@pytest.mark.parametrize(
    ("count", "words"),
    [(0, "0 px (0 %)"), (0.5, "0.5 px (0.05 %)"), (999.5, "1,000 px (100 %)")],
)
def test_pixels(count: float, words: str) -> None:
    assert pixels(count, count / 1000) == words
