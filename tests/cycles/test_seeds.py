"""The seeds of variants that draw sequences, as those of Cycles do."""

from itertools import pairwise

import pytest

from plateau.farm.model.seeds import SEQUENCE_SAMPLES, SeedSchedule, SeedsExhausted


def test_slices_of_each_half_follow_each_other_in_a_sequence_of_their_own():
    schedule = SeedSchedule("cycles:cpu", 640, 480, 100, 10_000, job_seed=3)
    ranges = [schedule.seed_range(index) for index in range(100)]
    for half in (0, 1):
        places = ranges[half::2]
        assert places[0].first == (2 * 3 + half) * SEQUENCE_SAMPLES
        assert all(b.first == a.last + 1 for a, b in pairwise(places))
        assert places[-1].last - places[0].first == 5_000 - 1
    # A pass begins with the sample after the one before it
    assert schedule.passes(4) == ((50, ranges[4].first), (50, ranges[4].first + 50))
    # Neither the cap nor the film's size changes a sample
    assert SeedSchedule("cycles:cpu", 8, 8, 100, 500, job_seed=3).passes(4) == schedule.passes(4)


def test_sequences_of_all_jobs_are_disjoint():
    last = SeedSchedule("cycles:cpu", 64, 64, 1, 1_000_000, 4095).seed_range(999_999)
    assert last.last < 2**32
    before = SeedSchedule("cycles:cpu", 64, 64, 1, 1_000_000, 4094).seed_range(999_999)
    assert before.last < SeedSchedule("cycles:cpu", 64, 64, 1, 100, 4095).seed_range(0).first


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("cycles:cpu", 64, 64, 600_000, 600_000), r"two sequences of 524288 samples.*lower max"),
        (("cycles:cpu", 64, 64, 25, 100, 0, 512), r"whole films alone.*the allocation frame$"),
    ],
)
def test_a_job_that_would_run_out_of_seeds_is_refused_with_a_way_out(arguments, says):
    with pytest.raises(SeedsExhausted, match=says):
        SeedSchedule(*arguments)
