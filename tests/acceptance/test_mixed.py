"""Workers that are unlike: one that is stuck holds up no job, and a job finds those it needs."""

import os

from tests.support.farms.real_farm import RealFarm
from tests.support.until import until

SPEC = {
    "parameters": {"width": 48, "height": 48},
    "step": 100,
    "slice_spp": 20,
    "max_spp": 400,
    "rule": {"name": "fixed", "spp": 400},
}


def test_a_job_waits_for_a_worker_of_its_pool_and_tags_and_says_so(farm: RealFarm) -> None:
    farm.start("monitor")
    farm.start("worker")
    until(lambda: len(farm.client.workers()) == 1)
    job = farm.submit(**{**SPEC, "pool": "night", "requires": ["gpu", "highmem"]})
    assert job.waits_for == (
        "waits for a worker in pool night with tags gpu, highmem: there is none that takes work"
    )
    # One that has but one of the tags is of no use
    farm.start("worker", "--pool", "night", "--tag", "gpu")
    until(lambda: len(farm.client.workers()) == 2)
    assert farm.client.job(job.id).waits_for == job.waits_for
    farm.start("worker", PLATEAU_POOL="night", PLATEAU_TAGS="highmem,fast,gpu")
    done = farm.client.wait(job.id)
    assert (done.state, done.waits_for) == ("converged", None)
    (worker,) = {part.worker for part in farm.client.slices(job.id)}
    workers = farm.client.workers
    shown = until(lambda: [one for one in workers() if one.id == worker and one.samples_per_s])[0]
    assert (shown.pool, shown.tags) == ("night", ("fast", "gpu", "highmem"))
    # It says what its machine does, and what it has cost
    machine = shown.machine
    assert machine is not None
    assert machine.cores == os.cpu_count()
    assert 0 <= machine.load <= 1
    assert 0 < machine.memory_used_bytes < machine.memory_bytes
    assert machine.disk_free_bytes is not None
    assert 0 < machine.disk_free_bytes < (machine.disk_bytes or 0)
    assert 0 < (shown.core_hours or 0) < 1.01 * done.core_hours
