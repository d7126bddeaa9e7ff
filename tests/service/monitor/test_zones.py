"""A job that is allocated by zones: its samples go where more is left to see."""

from pathlib import Path

import numpy as np
import pytest
import redis

from plateau.farm.images.exr import decode_image, decode_layers
from plateau.farm.ledger.queue import Committed
from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from plateau.service.api.points import KeptSlice
from plateau.service.api.points.sums import PointSums
from tests.support.every_time import save_every_time
from tests.support.invariants import check_job
from tests.support.noise_farm import SIZE, NoiseFarm
from tests.support.until import until

PIXELS = SIZE[0] * SIZE[1]
ZONES = {"allocation": {"name": "zones", "size": 16}, "step": 40, "slice_spp": 10}
#: Of the ramp, the dark zones need more samples than the bright ones.
JOB = {**ZONES, "rule": {"name": "visible", "target": 0.02}, "max_spp": 4000}


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, tmp_path: Path) -> NoiseFarm:
    farm = NoiseFarm(client, redis_url, tmp_path, sigma=0.15)
    farm.variant = "llvm_ad_rgb"
    return farm


def finished(farm: NoiseFarm, **spec: object) -> Job:
    job = farm.submit(**spec)
    with farm.monitor():
        done = farm.finish(job)
    check_job(farm.jobs, farm.store, farm.jobs._redis, job.id)
    return done


def test_dark_zones_of_a_ramp_have_more_samples_than_bright_ones(farm: NoiseFarm) -> None:
    done = finished(farm, **JOB)
    assert done.state is JobState.CONVERGED
    layers = decode_layers(farm.picture(done, "image.exr"))
    spp = layers["spp"]
    assert spp[:, :16].mean() > spp[:, 16:].mean()
    assert (spp.min(), spp.max()) == (done.spp_min, done.spp_max)
    assert done.spp == int(spp.mean())
    # As whole frames it needs more
    frame = finished(farm, **{**JOB, "allocation": {"name": "frame"}})
    assert frame.state is JobState.CONVERGED
    assert frame.spp > spp.mean()


def test_its_curve_has_the_mean_and_the_least_and_the_most(farm: NoiseFarm) -> None:
    done = finished(farm, **JOB)
    curve = farm.jobs.curve(done.id)
    assert [point.spp for point in curve[:2]] == [40, 80]
    for point in curve:
        assert point.samples is not None
        assert point.spp_min is not None
        assert point.spp_max is not None
        assert point.spp == point.samples // PIXELS
        assert point.spp_min <= point.spp <= point.spp_max
    assert farm.jobs.census().samples == farm.jobs.plan(done).samples(
        len(farm.jobs.ledger(done.id))
    )
    assert done.samples_saved == 4000 * PIXELS - curve[-1].samples


def test_its_image_depends_on_no_monitor_and_no_order(
    farm: NoiseFarm, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_every_time(monkeypatch)
    one, other = finished(farm, **JOB), farm.submit(**JOB)
    # When the monitor changes all the time, and slices come last first
    while not farm.is_finished(other):
        with farm.monitor():
            held = [lease for lease in (farm.lease() for _ in range(6)) if lease]
            for lease in reversed(held):
                farm.commit(lease)
            if not held:
                until(lambda: farm.is_finished(other) or may_lease(farm))
    assert farm.jobs.get(other.id).reason == one.reason
    assert curve(farm, other) == curve(farm, one)
    images = [decode_layers(farm.picture(job, "image.exr")) for job in (one, other)]
    for name, values in images[0].items():
        np.testing.assert_array_equal(values, images[1][name])


def may_lease(farm: NoiseFarm) -> bool:
    return farm.jobs.census().slices["waiting"] > 0


def curve(farm: NoiseFarm, job: Job) -> list[dict[str, object]]:
    return [point.model_dump(exclude={"at"}) for point in farm.jobs.curve(job.id)]


def test_at_its_cap_it_is_exhausted_and_never_above(farm: NoiseFarm) -> None:
    job = {**ZONES, "rule": {"name": "visible", "target": 1e-6}, "max_spp": 410}
    done = finished(farm, **job)
    assert done.state is JobState.EXHAUSTED
    assert done.reason.startswith("reached the cap of 410 spp")
    assert done.committed_spp == done.spp
    assert 400 < done.spp <= 410


def test_a_cap_within_its_first_rounds_is_met(farm: NoiseFarm) -> None:
    done = finished(farm, **{**ZONES, "rule": {"name": "fixed", "spp": 50}, "max_spp": 50})
    assert (done.state, done.spp) == (JobState.CONVERGED, 50)


def test_a_partial_of_other_zones_is_rendered_again(
    farm: NoiseFarm, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = farm.submit(**JOB)
    with farm.monitor():
        farm.work(lambda: farm.jobs.get(job.id).points >= 2)
        lease = farm.next_lease()
        while lease.round is None or lease.round.zones is None:
            farm.commit(lease)
            lease = farm.next_lease()
        with monkeypatch.context() as patch:  # as a worker that knows nothing of zones
            patch.setattr(NoiseFarm, "_zones", staticmethod(lambda _: ()))
            assert farm.commit(lease) is Committed.COMMITTED
        again = until(lambda: [one for one in farm.jobs.log(job.id) if one.what == "rejected"])
        assert again[0].slice == lease.index
        done = farm.finish(job)
    assert done.state is JobState.CONVERGED


def test_one_that_kept_its_slices_has_a_picture_of_each_point(farm: NoiseFarm) -> None:
    done = finished(farm, **JOB, keep_slices=True)
    plan, ledger = farm.jobs.plan(done), farm.jobs.ledger(done.id)
    slices = [
        KeptSlice(ledger[index]["blob"], ledger[index]["sha256"])
        for index in range(plan.slices_of(done.spp))
    ]
    image = PointSums(farm.store).image(
        done.id, slices, is_given_up=lambda: False, zone_size=plan.size
    )
    np.testing.assert_array_equal(image, decode_image(farm.picture(done, "image.exr")))
