"""Waits double up to a limit, and no two processes wait alike."""

import pytest

from plateau.farm.process.backoff import Backoff


def test_waits_double_up_to_the_longest_each_spread_by_half() -> None:
    backoff = Backoff(1.0, 4.0)
    for unspread in (1.0, 2.0, 4.0, 4.0):
        assert unspread / 2 <= backoff.delay_s() <= 1.5 * unspread
    backoff.reset()
    assert backoff.delay_s() <= 1.5


def test_many_that_begin_together_do_not_come_back_together() -> None:
    # Uniform over [0.5, 1.5]: that a hundred lie within a quarter has a chance below 1e-56
    waits = [Backoff(1.0, 4.0).delay_s() for _ in range(100)]
    assert max(waits) - min(waits) > 0.25


@pytest.mark.parametrize("times", [1, 50])
def test_no_wait_is_longer_than_the_longest_and_a_half(times: int) -> None:
    backoff = Backoff(0.25, 5.0)
    assert max(backoff.delay_s() for _ in range(times)) <= 7.5
