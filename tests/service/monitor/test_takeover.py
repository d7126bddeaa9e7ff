"""A failed job that another monitor finishes has the image that it had."""

import numpy as np
import pytest
import redis

from plateau.farm.images.exr import decode_image
from plateau.farm.ledger.ownership import Ownerships
from plateau.farm.model.states import JobState
from tests.support.farms.every_time import save_every_time
from tests.support.farms.noise_farm import NoiseFarm, noise_film
from tests.support.faults.invariants import check_job
from tests.support.until import until

SLICE, STEP, SHOWN = 10, 20, 100
#: So many slices are in the last checkpoint when ten are merged: five are too few for another.
IN_CHECKPOINT = 6


def test_of_all_that_the_monitor_before_had_merged(
    farm: NoiseFarm, client: redis.Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_every_time(monkeypatch)
    monkeypatch.setattr("plateau.service.monitor.known.SLICES_PER_CHECKPOINT", 5)
    # Given a job that failed beyond its last checkpoint, when its monitor had gone
    job = farm.submit(step=STEP, slice_spp=SLICE, max_spp=4000, rule={"name": "fixed", "spp": 4000})
    with farm.monitor():
        farm.render(SHOWN // SLICE)
        until(lambda: farm.jobs.get(job.id).image_spp == SHOWN)
        lease = farm.next_lease()
    checkpoint = Ownerships(client, 5.0).checkpoint(job.id)
    assert checkpoint is not None
    assert checkpoint.slices == IN_CHECKPOINT
    farm.queue.fail(lease, "no texture of that name", 1.0, "")
    assert farm.jobs.get(job.id).state is JobState.FAILED
    # When another monitor finishes it
    with farm.monitor():
        until(lambda: farm.is_finished(job))
    check_job(farm.jobs, farm.store, farm.jobs._redis, job.id)
    done = farm.jobs.get(job.id)
    # Then the image is the one that was shown, and the curve ends with it
    assert (done.spp, done.image_spp, farm.jobs.curve(done.id)[-1].spp) == (SHOWN,) * 3
    films = sum(noise_film(i, SLICE, farm.sigma).astype(np.float64) for i in range(SHOWN // SLICE))
    image = decode_image(farm.picture(done, "image.exr"))
    np.testing.assert_array_equal(image, (films[..., :3] / films[..., 3:]).astype(np.float32))
    # And its sums are of all of it too
    sums = Ownerships(client, 5.0).checkpoint(done.id)
    assert sums is not None
    assert sums.slices == SHOWN // SLICE
