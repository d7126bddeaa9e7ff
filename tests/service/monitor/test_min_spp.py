"""`min_spp`: whatever the rule says, no job converges before it."""

from pathlib import Path

import pytest
import redis

from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from tests.service.monitor.test_monitor import QUICK, work
from tests.support.farms.noise_farm import NoiseFarm


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, tmp_path: Path) -> NoiseFarm:
    return NoiseFarm(client, redis_url, tmp_path)


def ended(farm: NoiseFarm, **spec: object) -> Job:
    job = farm.submit(**{**QUICK, **spec})
    with farm.monitor():
        return work(farm, job)


def stops(farm: NoiseFarm, job: Job, rule: str = "reverse") -> list[int]:
    """At which spp the rule would have stopped it."""
    return [point.spp for point in farm.jobs.curve(job.id) if point.rules[rule].stop]


def test_a_job_goes_on_till_then_and_ends_by_its_rule(farm: NoiseFarm) -> None:
    free = ended(farm)
    assert "min_spp" not in free.reason
    least = free.spp + 50  # between two evaluations
    held = ended(farm, min_spp=least)
    # The curve says what the rule said all along
    assert stops(farm, held)[0] == free.spp
    # And the job ended where it said so first beyond
    assert held.state is JobState.CONVERGED
    assert held.spp == min(spp for spp in stops(farm, held) if spp >= least) > free.spp
    assert held.verdict is not None
    assert "levelled off" in held.reason
    if held.spp - 20 < least:
        assert f"min_spp is {least}, so it could not end earlier" in held.reason


def test_one_that_the_rule_reaches_late_changes_nothing(farm: NoiseFarm) -> None:
    free = ended(farm)
    held = ended(farm, min_spp=40)
    assert (held.spp, held.reason) == (free.spp, free.reason)


def test_a_fixed_number_of_samples_gives_way_to_it(farm: NoiseFarm) -> None:
    job = ended(farm, rule={"name": "fixed", "spp": 40}, min_spp=110)
    assert (job.state, job.spp) == (JobState.CONVERGED, 120)
    assert job.reason.endswith("min_spp is 110, so it could not end earlier")


def test_as_high_as_the_cap_it_lets_the_rule_decide_there(farm: NoiseFarm) -> None:
    job = ended(farm, rule={"name": "fixed", "spp": 20}, max_spp=80, min_spp=80)
    assert (job.state, job.spp) == (JobState.CONVERGED, 80)
