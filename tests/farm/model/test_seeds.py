"""The seed schedule: pure passes, disjoint samples, and clear refusals."""

import doctest
from collections import Counter
from itertools import combinations, pairwise

import pytest
from hypothesis import example, given, reject
from hypothesis import strategies as st

import plateau.farm.model.passes
from plateau.farm.model.passes import (
    LARGEST_SPP,
    largest_single_call,
    passes_in_parts,
    single_call_passes,
)
from plateau.farm.model.seeds import SeedSchedule, SeedsExhausted

SIDES = st.integers(1, 700)


def test_examples_in_docstrings_hold():
    assert doctest.testmod(plateau.farm.model.passes) == (0, 5)


@given(st.integers(1, 4096), st.integers(1, 512))
def test_passes_are_descending_powers_of_two_that_sum_to_the_slice(slice_spp, largest):
    parts = single_call_passes(slice_spp, largest)
    assert sum(parts) == slice_spp
    assert all(part & (part - 1) == 0 for part in parts)
    assert max(parts) <= largest
    assert all(a >= b for a, b in pairwise(parts))


@pytest.mark.parametrize(("slice_spp", "largest"), [(0, 1), (1, 0), (-3, 4)])
def test_a_slice_has_samples(slice_spp, largest):
    with pytest.raises(ValueError, match="at least 1"):
        single_call_passes(slice_spp, largest)


@pytest.mark.parametrize(
    ("size", "spp"),
    [((512, 512), 4), ((256, 256), 16), ((333, 255), 8), ((1, 1), 2**20), ((4096, 4096), 1)],
)
def test_the_largest_single_call_is_about_a_million_samples(size, spp):
    assert largest_single_call(size[0] * size[1]) == spp


@given(SIDES, SIDES, st.integers(1, 64), st.integers(0, 2), st.randoms(use_true_random=False))
@example(512, 512, 25, 0, None)
@example(40, 24, 1, 1, None)  # more numbers in its blocks than pixels
def test_scalar_passes_of_a_job_and_of_other_job_seeds_never_share_a_random_number(
    width, height, slice_spp, job_seed, random
):
    # Given the first, the last and some other slices of jobs that differ in their seed alone
    starts = []
    for seed in (job_seed, job_seed + 1):
        try:
            schedule = SeedSchedule("scalar_rgb", width, height, slice_spp, 40 * slice_spp, seed)
        except SeedsExhausted:
            reject()
        chosen = {0, 39} | ({random.randrange(40) for _ in range(5)} if random else set(range(40)))
        # When Mitsuba starts each pass at seed · width · height, in 32 bits
        starts += [
            one.seed * width * height % 2**32
            for index in sorted(chosen)
            for one in schedule.passes(index)
        ]
    # Then no two ranges of 32 × 32 numbers for each block touch, around the end of 2**32 too
    used = -(-width // 32) * -(-height // 32) * 32 * 32
    starts.sort()
    assert all(b - a >= used for a, b in pairwise(starts))
    assert starts[-1] + used <= 2**32


@given(SIDES, SIDES, st.integers(1, 64), st.integers(0, 4094))
def test_jit_seeds_are_distinct_32_bit_numbers_in_all_jobs(width, height, slice_spp, job_seed):
    seen = [
        one.seed
        for seed in (job_seed, job_seed + 1)
        for index in (0, 1, 399)
        for one in SeedSchedule(
            "llvm_ad_rgb", width, height, slice_spp, 400 * slice_spp, seed
        ).passes(index)
    ]
    assert len(set(seen)) == len(seen)
    assert all(0 <= seed < 2**32 for seed in seen)


@pytest.mark.parametrize("variant", ["scalar_rgb", "llvm_ad_rgb", "cuda_ad_rgb"])
def test_ledger_ranges_are_consecutive_over_the_job(variant):
    schedule = SeedSchedule(variant, 333, 255, 25, 1000, 3)
    assert schedule.slices == 40
    ranges = [schedule.seed_range(index) for index in range(40)]
    assert all(b.first == a.last + 1 for a, b in pairwise(ranges))
    assert all(r.last - r.first + 1 == len(schedule.passes(i)) for i, r in enumerate(ranges))


def test_other_job_seeds_have_other_ledger_ranges():
    for variant in ("scalar_rgb", "llvm_ad_rgb"):
        last = SeedSchedule(variant, 64, 64, 25, 1000, 0).seed_range(39).last
        assert SeedSchedule(variant, 64, 64, 25, 1000, 1).seed_range(0).first > last


def test_frames_have_ranges_of_their_own_as_far_as_there_are_seeds():
    def first(variant, job_seed, frame_seed):
        schedule = SeedSchedule(variant, 512, 512, 25, 10_000, job_seed, frame_seed=frame_seed)
        return schedule.seed_range(0).first

    # Given a variant with seeds for every frame, and one with seeds for five such jobs
    assert [first("llvm_ad_rgb", k % 4096, k) for k in (0, 1, 4095)] == [0, 2**20, 4095 * 2**20]
    scalar = [first("scalar_rgb", frame, frame) for frame in range(12)]
    # Then neighbours differ, and the frames after the last seed begin again
    assert len(set(scalar[:5])) == 5
    assert scalar[5:10] == scalar[:5]
    # Another seed of the batch gives each frame other samples, also where it wraps
    other = [first("scalar_rgb", 3 + frame, frame) for frame in range(12)]
    assert all(one != two for one, two in zip(scalar, other, strict=True))
    assert first("llvm_ad_rgb", (4000 + 200) % 4096, 200) == 104 * 2**20


def test_a_slice_is_a_pure_function_of_the_schedule_and_its_index():
    one, other = (SeedSchedule("scalar_rgb", 333, 255, 25, 1000, 1) for _ in range(2))
    backwards = [other.passes(index) for index in reversed(range(40))]
    assert [one.passes(index) for index in range(40)] == backwards[::-1]


def test_jit_seeds_do_not_depend_on_the_cap():
    # so that a job can be raised above its cap, and go on
    short, long = (SeedSchedule("llvm_ad_rgb", 64, 64, 25, cap, 1) for cap in (100, 10_000))
    assert short.passes(3) == long.passes(3)


def test_scalar_passes_repeat_no_distance():
    # Distances that repeat would add up PCG32's faint correlations (see the module's docstring).
    # Of consecutive seeds, 63 pairs of these would be one apart.
    schedule = SeedSchedule("scalar_rgb", 333, 255, 1, 64)
    starts = [one.seed for index in range(64) for one in schedule.passes(index)]
    distances = Counter(abs(a - b) for a, b in combinations(starts, 2))
    assert max(distances.values()) <= 4


@given(st.integers(1, 4096), st.integers(1, 2**26), st.booleans())
def test_passes_in_parts_are_even_and_sum_to_the_slice(slice_spp, pixels, is_first):
    parts = passes_in_parts(slice_spp, pixels, is_first=is_first)
    assert sum(parts) == slice_spp
    later = parts[is_first and len(parts) > 1 :]
    assert max(later) - min(later) <= 1
    assert max(parts) <= LARGEST_SPP
    assert max(parts) * pixels < 2**32  # each sample has a number of its own


def test_the_first_slice_begins_with_a_pass_that_can_be_shown_soon():
    schedule = SeedSchedule("llvm_ad_rgb", 256, 256, 25, 100)
    assert [schedule.pass_spp(index) for index in range(3)] == [(4, 21), (25,), (25,)]
    # of 1 spp at least, and not where the whole slice is as short
    assert SeedSchedule("cuda_ad_rgb", 1920, 1080, 25, 100).pass_spp(0) == (1, 24)
    assert SeedSchedule("llvm_ad_rgb", 64, 64, 25, 100).pass_spp(0) == (25,)


def test_scarce_scalar_seeds_make_passes_larger():
    # 1024×1024 has 4096 disjoint passes; passes of 1 spp would take 10,000 of them
    assert SeedSchedule("scalar_rgb", 1024, 1024, 25, 100).pass_spp(0) == (1,) * 25
    assert SeedSchedule("scalar_rgb", 1024, 1024, 25, 10_000).pass_spp(0) == (4,) * 6 + (1,)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("scalar_rgb", 4096, 4096, 25, 10_000), r"take 1200 passes.*4096×4096.*for 256.*LLVM"),
        (("scalar_rgb", 512, 512, 25, 10_000, 5), r"job seed 5 is too large.*0 to 4 fit.*LLVM"),
        (("scalar_rgb", 512, 512, 25, 10_000, 9, 0, 4), r"job seed 5 is too large.*0 to 4 fit"),
        (("llvm_ad_rgb", 512, 512, 25, 10_000, 4096), r"0 to 4095 fit$"),
        (("llvm_ad_rgb", 512, 512, 1, 2**20 + 1), r"take 1048577 passes.*raise slice_spp"),
        (("scalar_rgb", 2**16, 2**16, 1, 2), r"take 2 passes.*for 1"),
    ],
)
def test_a_job_that_would_run_out_of_seeds_is_refused_with_a_way_out(arguments, says):
    with pytest.raises(SeedsExhausted, match=says):
        SeedSchedule(*arguments)


def test_the_last_job_that_fits_is_accepted():
    SeedSchedule("scalar_rgb", 512, 512, 25, 10_000, 4).passes(399)
    SeedSchedule("llvm_ad_rgb", 512, 512, 1, 2**20, 4095).passes(2**20 - 1)


@pytest.mark.parametrize(
    "change",
    [{"width": 0}, {"height": -1}, {"slice_spp": 0}, {"max_spp": 0}, {"job_seed": -1},
     {"variant": "metal_ad_rgb"}],
)  # fmt: skip
def test_values_out_of_their_domain_are_refused(change):
    valid = {"variant": "scalar_rgb", "width": 8, "height": 8, "slice_spp": 4, "max_spp": 8}
    with pytest.raises(ValueError, match=next(iter(change)).split("_")[0]):
        SeedSchedule(**{**valid, **change})


@pytest.mark.parametrize("index", [-1, 4])
def test_there_is_no_slice_outside_the_job(index):
    with pytest.raises(SeedsExhausted, match="outside the job's 4 slices"):
        SeedSchedule("scalar_rgb", 8, 8, 25, 100).passes(index)
