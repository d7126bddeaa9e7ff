"""Waits double up to a limit, and no two processes wait alike."""

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
