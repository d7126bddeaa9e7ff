"""A paused job frees its workers; resumed, it ends as if it had never been paused."""

import pytest

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
