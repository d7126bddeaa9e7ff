"""A histogram of durations adds up, whoever noted them and whatever bounds they had."""

import pytest

from plateau.farm.model.durations import Durations, histogram

INF = float("inf")


def test_a_run_counts_in_every_bucket_that_it_fits() -> None:
    noted = Durations((0.1, 1.0))
    for seconds in (0.05, 0.1, 0.5, 7.0):
        noted.note(seconds)
    found = histogram(noted.numbers("merge"), "merge", (0.1, 1.0))
    assert found.buckets == ((0.1, 2), (1.0, 3), (INF, 4))
    assert found.sum_s == pytest.approx(7.65)


def test_nothing_noted_is_a_histogram_of_zeros() -> None:
    numbers = Durations((0.1,)).numbers("merge")
    assert histogram(numbers, "merge", (0.1,)).buckets == ((0.1, 0), (INF, 0))


def test_numbers_of_two_add_up_to_the_histogram_of_both() -> None:
    one, other = Durations((0.1, 1.0)), Durations((0.1, 1.0))
    one.note(0.05)
    other.note(0.5)
    other.note(2.0)
    numbers, more = one.numbers("merge"), other.numbers("merge")
    both = {key: numbers[key] + more[key] for key in numbers}
    found = histogram({**both, "evaluation le 0.1": 9, "samples": 1}, "merge", (0.1, 1.0))
    assert found.buckets == ((0.1, 1), (1.0, 2), (INF, 3))
    assert found.sum_s == pytest.approx(2.55)


def test_runs_under_the_bounds_of_an_older_plateau_stay_in_it() -> None:
    found = histogram({"merge le 0.3": 2, "merge le inf": 1}, "merge", (0.1, 1.0))
    assert found.buckets == ((0.1, 0), (0.3, 2), (1.0, 2), (INF, 3))


def test_what_ends_by_an_error_is_not_timed() -> None:
    noted = Durations((0.1,))
    with noted.timed():
        pass
    with pytest.raises(KeyError), noted.timed():
        raise KeyError
    assert histogram(noted.numbers("merge"), "merge", (0.1,)).buckets[-1] == (INF, 1)
