"""What each slice of a job has, and what that makes of samples per pixel."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.slices.rounds import Round
from plateau.farm.model.slices.zones import Grid, pixels_of
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.spec.parts import LAG

WIDTH, HEIGHT = 100, 50
SPEC = JobSpec.model_validate(
    {"allocation": {"name": "zones", "size": 32}, "step": 40, "slice_spp": 10, "max_spp": 500}
)
GRID = Grid(WIDTH, HEIGHT, 32)  # 2 rows of 4


def plan(*rounds: Round) -> Plan:
    return Plan.of(SPEC, WIDTH, HEIGHT, rounds)


def test_zones_cover_the_film_once() -> None:
    zones = GRID.zones()
    assert len(zones) == GRID.rows * GRID.columns == 8
    assert pixels_of(zones) == WIDTH * HEIGHT
    assert zones[-1] == (96, 32, 4, 18)


@given(st.sets(st.integers(0, 7)))
def test_joined_they_cover_the_same(numbers: set[int]) -> None:
    def covered(zones: tuple[tuple[int, int, int, int], ...]) -> list[tuple[int, int]]:
        return sorted((x + i, y + j) for x, y, w, h in zones for i in range(w) for j in range(h))

    assert covered(GRID.joined(sorted(numbers))) == covered(GRID.zones(sorted(numbers)))


@given(
    st.integers(0, 10**5),
    st.integers(0, 500),
    st.integers(1, 500),
    st.none() | st.sets(st.integers(0, 2000)),
    st.integers(1, 10**7),
)
def test_a_round_is_stored_and_read(
    first: int, slices: int, spp: int, zones: set[int] | None, pixels: int
) -> None:
    one = Round(first, slices, spp, None if zones is None else tuple(sorted(zones)), pixels)
    assert Round.from_json(one.as_json()) == one


def test_by_frame_all_slices_are_alike() -> None:
    frames = Plan.of(JobSpec(max_spp=1050, allocation="frame"), WIDTH, HEIGHT)
    assert (frames.stop, frames.is_complete) == (42, True)
    assert [at for at in range(43) if frames.is_point(at)] == [*range(4, 43, 4), 42]
    assert (frames.spp(5), frames.slices_of(125), frames.samples(5)) == (125, 5, 125 * 5000)
    assert [frames.point_from(spp) for spp in (1, 100, 101)] == [4, 4, 8]
    assert not frames.decides(4)
    assert frames.slice_round(40) is None


def test_the_first_rounds_are_whole_films_and_images_decide_the_others() -> None:
    first = plan()
    assert first.stop == LAG * 4
    assert [first.slice_round(index) for index in range(first.stop)] == [None] * first.stop
    assert [at for at in range(9) if first.decides(at)] == [4]
    one = first.round_of([1, 0], 40, 10)
    assert one == Round(8, 4, 10, (0, 1), 2048)
    then = first.with_round(one)
    assert (then.stop, then.slice_round(8), then.slice_round(11)) == (12, one, one)
    assert [at for at in range(13) if then.decides(at)] == [8]


@pytest.mark.parametrize(
    ("spp", "slice_spp", "slices", "each"),
    [(40, 100, 4, 10), (40, 5, 8, 5), (41, 5, 12, 4), (5, 1, 8, 1), (3000, 10_000, 8, 375)],
)
def test_a_round_has_slices_of_no_more_than_is_asked(
    spp: int, slice_spp: int, slices: int, each: int
) -> None:
    first = Plan.of(SPEC.model_copy(update={"max_spp": 5000}), WIDTH, HEIGHT)
    one = first.round_of([1, 0], spp, slice_spp)
    assert (one.slices, one.spp) == (slices, each)
    # The next round begins where it ends, and each has points and slices of its own
    then = first.with_round(one)
    other = then.round_of(None, 8, 2)
    both = then.with_round(other)
    assert (other.first, both.stop) == (8 + slices, 12 + slices)
    assert list(filter(both.is_point, range(both.stop + 1))) == [4, 8, other.first, both.stop]
    assert list(map(both.slice_round, (7, 8, 7 + slices, other.first))) == [None, one, one, other]
    assert [at for at in range(both.stop + 1) if both.decides(at)] == [other.first]
    assert [both.rounds(at) for at in (3, 4, other.first - 1, other.first)] == [0, 1, 2, 3]
    assert both.end_of_rounds(other.first + 1) == other.first


def test_spp_are_the_mean_over_the_film() -> None:
    some = plan(Round(8, 4, 10, (0, 1), 2048), Round(12, 4, 30, None, 5000))
    assert some.samples(12) == 80 * 5000 + 40 * 2048
    assert some.spp(12) == 96
    assert some.spp(16) == 216
    assert all(a <= b for a, b in pairwise(some.spp(at) for at in range(17)))
    # Of slices with the same spp, those at which the image is judged come first
    assert [some.slices_of(some.spp(at)) for at in (4, 8, 12, 16)] == [4, 8, 12, 16]
    assert [some.point_from(spp) for spp in (81, 96, 97, 1000)] == [12, 12, 16, 16]


def test_the_cap_makes_the_last_round_smaller_and_ends_the_plan() -> None:
    first = plan()
    last = first.round_of(None, 800, 200)
    assert last.spp == (500 - 80) // 4
    full = first.with_round(last)
    assert full.spp(full.stop) == 500
    assert not full.is_complete
    end = full.round_of([3], 40, 10)
    assert end.slices == 0
    assert full.with_round(end).is_complete
    assert full.with_round(end).stop == full.stop == 12


def test_a_cap_just_above_the_first_rounds_is_reached() -> None:
    beyond = Plan.of(SPEC.model_copy(update={"max_spp": 85}), WIDTH, HEIGHT)
    assert (beyond.stop, beyond.is_complete) == (8, False)
    last = beyond.round_of(None, 40, 10)
    assert (last.slices, last.spp) == (4, 1)


@pytest.mark.parametrize("cap", [40, 50, 80])
def test_a_cap_within_the_first_rounds_completes_it(cap: int) -> None:
    small = Plan.of(SPEC.model_copy(update={"max_spp": cap}), WIDTH, HEIGHT)
    assert small.is_complete
    assert small.stop == cap // 10
    assert small.is_point(small.stop)


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"allocation": {"name": "zones", "size": 40}}, "multiple of 16"),
        ({"allocation": {"name": "zones", "size": 0}}, "greater than or equal to 16"),
        ({"allocation": {"name": "tiles"}}, "tiles"),
        ({"variant": "scalar_rgb"}, "scalar_rgb renders whole films alone"),
    ],
)
def test_what_cannot_be_allocated_is_refused(change: dict[str, object], error: str) -> None:
    with pytest.raises(ValidationError, match=error):
        JobSpec.model_validate({**SPEC.model_dump(), **change})


def test_slices_of_zones_have_seeds_of_their_own_whatever_their_spp() -> None:
    schedule = SPEC.seed_schedule("llvm_ad_rgb", WIDTH, HEIGHT)
    spps = [10, 10, 512, 1, 300]
    ranges = [schedule.seed_range(index, spp) for index, spp in enumerate(spps)]
    assert all(one.last < next_one.first for one, next_one in pairwise(ranges))
    for index, spp in enumerate(spps):
        passes = schedule.passes(index, spp)
        assert sum(one.spp for one in passes) == spp
        assert [one.seed for one in passes] == list(
            range(ranges[index].first, ranges[index].last + 1)
        )
