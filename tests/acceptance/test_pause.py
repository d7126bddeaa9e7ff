"""A paused job frees its workers; resumed, it ends as if it had never been paused."""

import pytest

from plateau.farm.blobs import names as blobs
from plateau.farm.ledger.workers import Workers
from tests.support.farms.faulty_farm import SPEC
from tests.support.farms.real_farm import RealFarm
from tests.support.faults.invariants import Outcome, assert_same, outcome
from tests.support.until import until


@pytest.fixture(scope="module")
def undisturbed(shared_farm: RealFarm) -> Outcome:
    """What comes of the job where nothing happens."""
    shared_farm.start("monitor")
    shared_farm.start("worker")
    found = outcome(shared_farm, shared_farm.submit(**SPEC).id)
    shared_farm.stop_all()
    assert found.job.state == "converged"
    return found


def paused_half_way(farm: RealFarm) -> str:
    """A job that is paused after some points of its curve, while its workers render."""
    job = farm.submit(**SPEC)
    until(lambda: farm.client.job(job.id).points >= 3)
    assert farm.client.pause(job.id).state == "paused"
    return job.id


@pytest.mark.long
def test_a_paused_job_ends_as_any_other(farm: RealFarm, undisturbed: Outcome) -> None:
    farm.start("monitor")
    farm.workers(2)
    until(lambda: len(farm.client.workers()) == 2)
    job = paused_half_way(farm)
    # Its workers come to an end with what they have, and take another job
    other = farm.submit(
        parameters={"width": 16, "height": 16},
        slice_spp=1,
        step=1,
        max_spp=4,
        priority=-1000,
        rule={"name": "fixed", "spp": 4},
    )
    assert farm.client.wait(other.id).state == "converged"
    until(lambda: all(worker.job is None for worker in farm.client.workers()))
    # All that was rendered is in its checkpoint, and shown
    until(lambda: farm.store.names(blobs.partials(job)) == [])
    paused = farm.client.job(job)
    until(lambda: f"{paused.committed_spp:07d}" in farm.jobs.results(job))
    assert farm.client.image(job, "image.png")
    assert (paused.state, paused.paused_at is not None) == ("paused", True)
    # When it is resumed, it goes on
    assert farm.client.resume(job).state == "rendering"
    found = outcome(farm, job)
    assert_same(found, undisturbed)
    assert found.job.paused_s > 0


@pytest.mark.long
def test_everything_may_die_while_a_job_is_paused(farm: RealFarm, undisturbed: Outcome) -> None:
    started = [farm.start("monitor"), *farm.workers(2)]
    until(lambda: len(farm.client.workers()) == 2)
    job = paused_half_way(farm)
    # Monitor and workers die at once, perhaps in the middle of a slice, and so does Redis
    for process in started:
        farm.kill(process)
    farm.redis.process.kill()
    farm.redis.process.wait()
    farm.redis.start()
    before = farm.client.job(job)
    assert before.state == "paused"
    # Others come; nothing happens to the job until it is resumed
    farm.start("monitor")
    farm.start("worker")
    until(lambda: len(Workers(farm.redis_client).living(1.0)) == 1)
    assert farm.client.job(job).committed_spp == before.committed_spp
    farm.client.resume(job)
    assert_same(outcome(farm, job), undisturbed)
