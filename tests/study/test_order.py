"""The order of pairs: counterbalanced, each level twice, and the same whenever it is asked for."""

from collections import Counter
from itertools import pairwise

import pytest

from plateau.study.order import Pair, pairs

#: The paper's.
SEVEN = (100, 500, 900, 1300, 1700, 2100, 2500)
STUDY = "9c1f47be02d8"
LEVELS = [SEVEN[:2], SEVEN[:3], SEVEN[:6], SEVEN, tuple(range(25, 625, 25))]


def blocks(levels: tuple[int, ...], number: int) -> tuple[list[int], list[int]]:
    spp = [pair.spp for pair in pairs(STUDY, levels, "constant", number)]
    return spp[: len(levels)], spp[len(levels) :]


@pytest.mark.parametrize("levels", LEVELS, ids=len)
class TestConstantStimuli:
    def test_each_level_is_shown_once_in_each_block_and_once_with_the_reference_at_each_side(
        self, levels: tuple[int, ...]
    ) -> None:
        for number in range(60):
            first, second = blocks(levels, number)
            assert sorted(first) == sorted(second) == list(levels)
            assert first[-1] != second[0]
            shown = pairs(STUDY, levels, "constant", number)
            assert len(set(shown)) == 2 * len(levels)
            sides = [pair.reference for pair in shown[: len(levels)]]
            assert abs(sides.count("left") - sides.count("right")) <= 1

    def test_over_all_rows_each_level_has_each_place_and_follows_each_other_equally_often(
        self, levels: tuple[int, ...]
    ) -> None:
        rows = [blocks(levels, number)[0] for number in range(2 * len(levels))]
        for place in zip(*rows, strict=True):
            assert set(Counter(place).values()) == {2}
        follows = Counter(step for row in rows for step in pairwise(row))
        assert len(follows) == len(levels) * (len(levels) - 1)
        assert set(follows.values()) == {2}


def test_the_first_stage_rises_and_falls() -> None:
    for number in range(4):
        shown = [pair.spp for pair in pairs(STUDY, SEVEN, "limits", number)]
        up, down = list(SEVEN), list(SEVEN[::-1])
        assert shown == (up + down if number % 2 == 0 else down + up)


def test_the_order_is_the_same_for_ever() -> None:
    # Written down: an observer who comes back after an upgrade goes on with the same pairs
    shown = pairs(STUDY, SEVEN[:3], "constant", 1)
    assert [(pair.spp, pair.reference) for pair in shown] == [
        (500, "left"),
        (100, "left"),
        (900, "right"),
        (100, "right"),
        (900, "left"),
        (500, "right"),
    ]


def test_studies_and_observers_differ() -> None:
    orders: set[tuple[Pair, ...]] = {
        pairs(study, SEVEN, "constant", number)
        for study in (STUDY, "0123456789ab")
        for number in range(20)
    }
    assert len(orders) == 40
