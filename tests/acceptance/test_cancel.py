"""A cancel frees the workers, and leaves only what every ended job has."""

import io

import pytest
from PIL import Image

from plateau.client import ApiError, ImageEvent
from tests.support.farms.real_farm import RealFarm
from tests.support.faults.invariants import check_job
from tests.support.until import until


def test_a_cancel_frees_the_workers_and_leaves_nothing(staffed: RealFarm) -> None:
    farm = staffed
    job = farm.submit(parameters={"width": 192, "height": 192}, max_spp=10_000)
    until(lambda: farm.client.job(job.id).spp >= 100)
    until(lambda: all(worker.job == job.id for worker in farm.client.workers()))
    # When it is cancelled
    assert farm.client.cancel(job.id).state == "cancelled"
    # Then its workers go to the next job
    following = farm.submit(
        parameters={"width": 16, "height": 16},
        slice_spp=1,
        step=1,
        max_spp=4,
        rule={"name": "fixed", "spp": 4},
    )
    done = farm.client.wait(following.id)
    until(lambda: all(worker.job is None for worker in farm.client.workers()))
    # And nothing of it is left in the queue, or among the blobs but what every ended job has
    farm.client.wait(job.id)
    assert not farm.redis_client.exists(f"plateau:job:{job.id}:slices")
    assert not farm.redis_client.zscore("plateau:jobs:open", job.id)
    check_job(farm.jobs, farm.store, farm.redis_client, job.id)
    # Cancelling it again is harmless
    assert farm.client.cancel(job.id).state == "cancelled"
    assert done.state == "converged"


def test_a_job_is_seen_and_cancelled_before_its_first_slice_is_there(farm: RealFarm) -> None:
    farm.start("monitor")
    farm.workers(1)
    # Given slices that take minutes
    job = farm.submit(
        parameters={"width": 256, "height": 192}, slice_spp=4000, step=4000, max_spp=8000
    )
    # Then its first pass is to be seen
    until(lambda: farm.client.job(job.id).image_spp is not None)
    seen = farm.client.job(job.id)
    assert (seen.spp, seen.committed_spp) == (0, 0)
    told = [one for one in farm.client.happened(job.id) if isinstance(one, ImageEvent)]
    assert [one.spp for one in told] == [seen.image_spp]
    assert Image.open(io.BytesIO(farm.client.image(job.id))).size == (256, 192)
    # And once it is cancelled it is no result
    farm.client.cancel(job.id)
    assert farm.client.wait(job.id).image_spp is None
    with pytest.raises(ApiError, match="left no image"):
        farm.client.image(job.id)
    check_job(farm.jobs, farm.store, farm.redis_client, job.id)
