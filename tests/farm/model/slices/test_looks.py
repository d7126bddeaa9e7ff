"""When a denoised image is looked at next."""

from hypothesis import given
from hypothesis import strategies as st

from plateau.farm.model.slices.looks import FREE_STEPS, LEAST_GROWTH, MOST_GROWTH, next_look
from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.spec import JobSpec

SPEC = JobSpec(step=100, slice_spp=25, max_spp=1000, denoise="oidn", allocation="frame")


def looks(*seen: tuple[int, int | None], spec: JobSpec = SPEC) -> list[int]:
    """The spp of all looks that are known, with the one that these decide."""
    plan = Plan.of(spec, looks=seen)
    return [at * spec.slice_spp for at in range(plan.stop + 1) if plan.is_point(at)]


@given(st.integers(1, 10**5), st.integers(1, 1000), st.none() | st.integers(1, 10**7))
def test_it_is_a_whole_step_later_and_never_much_later(
    spp: int, step: int, expected_spp: int | None
) -> None:
    later = next_look(spp, step, expected_spp)
    assert later > spp
    assert later % step == 0
    assert later >= LEAST_GROWTH * spp - step / 2
    assert later <= max(MOST_GROWTH * spp + step / 2, spp + FREE_STEPS * step)


def test_a_plan_knows_the_looks_of_the_curve_and_the_next_one() -> None:
    assert looks() == [100, 1000]
    assert looks((100, None)) == [100, 200, 1000]
    assert looks((100, 5000)) == [100, 300, 1000]
    assert looks((100, 5000), (300, 420)) == [100, 300, 500, 1000]
    # Of an older service, which looked elsewhere
    assert looks((100, 300), (200, 650)) == [100, 200, 400, 1000]
    # The cap has one, from which a job with a higher cap goes on
    assert looks((100, 5000), (1000, None)) == [100, 1000]
    higher = SPEC.model_copy(update={"max_spp": 2000})
    assert looks((100, 5000), (1000, None), spec=higher) == [100, 1000, 1200, 2000]


def test_a_look_that_is_known_stays() -> None:
    plan = Plan.of(SPEC, looks=[(100, 5000), (300, 900)])
    assert plan.with_point(4, 150) == plan
    assert plan.with_point(plan.slices_of(500), None).looks.spp == (100, 300, 500, 600)
    assert [plan.point_from(spp) for spp in (1, 101, 301, 501, 601)] == [4, 12, 20, 24, 28]


def test_no_job_without_denoising_has_looks() -> None:
    spec = JobSpec(step=100, slice_spp=25, max_spp=1000)
    plain = Plan.of(spec, looks=[(100, 200)])
    assert plain.looks is plain.with_point(4, 1000).looks is None
