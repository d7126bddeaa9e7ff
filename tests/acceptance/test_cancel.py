"""A cancel frees the workers, and leaves only what every ended job has."""

from tests.support.invariants import check_job
from tests.support.real_farm import RealFarm, until


def test_a_cancel_frees_the_workers_and_leaves_nothing(farm: RealFarm) -> None:
    farm.start("monitor")
    farm.workers(2)
    until(lambda: len(farm.client.workers()) == 2)
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
