"""A job that is allocated by zones: its samples go where more is left to see."""

from pathlib import Path

import numpy as np
import pytest
import redis

from plateau.farm.images.exr import decode_layers
from plateau.farm.ledger.totals import take_census
from plateau.farm.model.slices.zones import Zone
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.spec.whole_slices import fitted
from plateau.farm.model.states import JobState
from tests.support.farms.finished_jobs import finish_by_many_monitors, finished, go_on, loses
from tests.support.farms.lopsided_farm import HEIGHT, JOB, WIDTH, ZONES, LopsidedFarm
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.faults.invariants import check_job
from tests.support.long_tests import rare
from tests.support.until import until

PIXELS = HEIGHT * WIDTH
DENOISED = {
    **JOB,
    "rule": {"name": "visible", "target": 0.01, "min_spp": 1},
    "denoise": {"name": "oidn", "guides": False},
}
BY_QUALITY = {
    **JOB,
    "rule": {"name": "jod", "target": 9.5, "min_spp": 1},
    "view": {"pixels_per_degree": 20},
}
ANY = pytest.mark.parametrize(
    "spec", [JOB, DENOISED, BY_QUALITY], ids=["as it is", "denoised", "by quality"]
)
MOSTLY = pytest.mark.parametrize("spec", [JOB, *rare(DENOISED)], ids=["as it is", "denoised"])


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, tmp_path: Path) -> LopsidedFarm:
    return LopsidedFarm(client, redis_url, tmp_path, sigma=0.15)


@ANY
def test_noisy_zones_have_more_samples_than_calm_ones(
    farm: NoiseFarm, spec: dict[str, object]
) -> None:
    done = finished(farm, **spec)
    assert done.state is JobState.CONVERGED
    layers = decode_layers(farm.picture(done, "image.exr"))
    spp = layers["spp"]
    assert spp[:, :32].min() > spp[:, 64:].max()
    assert (spp.min(), spp.max()) == (done.spp_min, done.spp_max)
    assert done.spp == int(spp.mean())
    # Its curve has the mean, the least and the most
    curve = farm.jobs.curve(done.id)
    for point in curve:
        assert point.spp == (point.samples or 0) // PIXELS
        assert (point.spp_min or 0) <= point.spp <= (point.spp_max or 0)
    assert take_census(farm.client).samples == farm.jobs.plan(done).samples(
        len(farm.jobs.ledger(done.id))
    )
    assert done.samples_saved == 4000 * PIXELS - (curve[-1].samples or 0)
    # As whole frames it needs more
    frame = finished(farm, **{**spec, "allocation": {"name": "frame"}})
    assert frame.state is JobState.CONVERGED
    assert frame.spp > spp.mean()
    assert ("denoised.weight" in layers) == (spec is DENOISED)


def test_by_quality_the_target_says_how_many_samples_a_round_has(farm: NoiseFarm) -> None:
    rules = ({"name": "jod", "target": target, "min_spp": 1} for target in (9.0, 9.9))
    one, other = ({**BY_QUALITY, "rule": rule, "max_spp": 240} for rule in rules)
    near, far, again = finished(farm, **one), finished(farm, **other), farm.submit(**other)
    first = [farm.jobs.plan(job).decided[0].samples for job in (near, far)]
    forecasts = [farm.jobs.curve(job.id)[0].expected_spp or 0 for job in (near, far)]
    assert first[0] < first[1]
    assert 80 < forecasts[0] < forecasts[1]
    # Its image depends on no monitor and no order
    finish_by_many_monitors(farm, again)
    assert farm.jobs.plan(far).decided == farm.jobs.plan(again).decided
    images = [decode_layers(farm.picture(job, "image.exr")) for job in (far, again)]
    for name, values in images[0].items():
        np.testing.assert_array_equal(values, images[1][name])


@MOSTLY
def test_one_that_is_cancelled_says_the_least_and_the_most_of_its_image(
    farm: NoiseFarm, spec: dict[str, object]
) -> None:
    job = farm.submit(**{**spec, "rule": {"name": "visible", "target": 1e-6}})
    with farm.monitor():
        farm.work(lambda: farm.jobs.get(job.id).points >= 4)
        # Given a slice after the end of a round
        lease = farm.next_lease()
        while lease.round is None or lease.round.first != lease.index:
            farm.commit(lease)
            lease = farm.next_lease()
        farm.commit(lease)
        farm.jobs.cancel(job.id)
        done = farm.finish(job)
    assert done.spp > farm.jobs.curve(job.id)[-1].spp
    spp = decode_layers(farm.picture(done, "image.exr"))["spp"]
    assert done.spp == int(spp.mean(dtype=np.float64))
    assert (spp.min(), spp.max()) == (done.spp_min, done.spp_max)


def test_a_cap_within_its_first_rounds_is_met(farm: NoiseFarm) -> None:
    done = finished(farm, **{**ZONES, "rule": {"name": "fixed", "spp": 50}, "max_spp": 50})
    assert (done.state, done.spp) == (JobState.CONVERGED, 50)


@pytest.mark.parametrize(
    ("allocation", "denoiser", "cap"),
    [
        ("frame", "none", 33),
        ("frame", "oidn", 2),
        ("frame", "oidn", 97),
        ("zones", "none", 1),
        ("zones", "none", 201),
        ("zones", "oidn", 10),
        ("zones", "oidn", 97),
    ],
)
def test_a_cap_of_any_size_ends_the_job(
    farm: NoiseFarm, allocation: str, denoiser: str, cap: int
) -> None:
    asked = JobSpec.model_validate(
        {
            "allocation": {"name": allocation},
            "denoise": DENOISED["denoise"] if denoiser == "oidn" else {"name": "none"},
            "rule": {"name": "visible", "target": 1e-6},
            "max_spp": cap,
        }
    )
    spec = fitted(asked)
    done = finished(farm, **spec.model_dump(exclude={"name"}))
    assert done.state is JobState.EXHAUSTED
    assert 0.95 * spec.max_spp < done.spp <= spec.max_spp
    assert done.reason.startswith(f"reached the cap of {spec.max_spp} spp")
    assert done.committed_spp == done.spp


WRONG = {
    "the whole film": {"zones": (), "pixels": np.zeros((HEIGHT, WIDTH, 4), np.float32)},
    "another zone": {"zones": (Zone(0, 0, 16, 16),)},
    "a border": {"border": 1},
    "a border without end": {"border": 10**9},
    "a zone without end": {"zones": (Zone(0, 0, 2**31, 2**31),), "border": 1},
    "a zone of no size": {"zones": (Zone(0, 0, 16, -16), Zone(0, 0, 16, 16))},
}


def test_a_partial_of_other_zones_is_rendered_again(farm: LopsidedFarm) -> None:
    job = farm.submit(**JOB)

    def rejected() -> list[int]:
        return [one.slice for one in farm.jobs.log(job.id) if one.what == "rejected"]

    with farm.monitor():
        farm.work(lambda: farm.jobs.get(job.id).points >= 2)
        expected = []
        for farm.wrong in WRONG.values():
            # Given a slice of some zones, which was not wrong before
            wrong, farm.wrong = farm.wrong, {}
            lease = farm.next_lease()
            while lease.round is None or lease.round.zones is None or lease.index in expected:
                farm.commit(lease)
                lease = farm.next_lease()
            farm.wrong = wrong
            assert farm.commit(lease) == "committed"
            expected.append(lease.index)
            until(lambda: rejected() == expected)
        farm.wrong = {}
        done = farm.finish(job)
    assert done.state is JobState.CONVERGED


@pytest.mark.parametrize("keep_slices", [False, True], ids=["from its sums", "from its slices"])
def test_one_that_goes_on_is_as_if_it_had_never_stopped(farm: NoiseFarm, keep_slices: bool) -> None:
    def until_spp(spp: int) -> dict[str, object]:
        return {**ZONES, "rule": {"name": "fixed", "spp": spp}, "max_spp": 4000}

    stopped = finished(farm, **until_spp(120), keep_slices=keep_slices)
    never_stopped = finished(farm, **until_spp(240))
    with farm.monitor():
        done = farm.finish(go_on(farm, stopped, rule={"name": "fixed", "spp": 240}))
    assert done.state is JobState.CONVERGED
    check_job(farm.jobs, farm.store, farm.client, done.id)
    images = [decode_layers(farm.picture(job, "image.exr")) for job in (done, never_stopped)]
    for name, values in images[0].items():
        np.testing.assert_array_equal(values, images[1][name])
    assert done.spp == never_stopped.spp > stopped.spp


def test_one_that_its_cap_ended_goes_on_to_a_higher_cap(farm: NoiseFarm) -> None:
    never = {**ZONES, "rule": {"name": "visible", "target": 1e-6}}
    for cap, higher in ((80, 160), (250, 270)):
        capped = finished(farm, **never, max_spp=cap)
        with farm.monitor():
            done = farm.finish(go_on(farm, capped, max_spp=higher))
        assert done.state is JobState.EXHAUSTED
        assert cap < done.spp <= higher
        check_job(farm.jobs, farm.store, farm.client, done.id)


def test_its_kept_slices_can_be_judged_by_another_rule(farm: NoiseFarm) -> None:
    done = finished(farm, **JOB, keep_slices=True)
    assert loses(farm, done, allocation={"name": "frame"}) == "allocation"
    assert loses(farm, done, step=80) == "step"
    with farm.monitor():
        again = farm.finish(
            go_on(farm, done, rule={"name": "visible", "target": 0.5}, max_spp=done.spp)
        )
    assert again.state is JobState.CONVERGED
    assert again.spp < done.spp
    assert again.machine_s == 0
