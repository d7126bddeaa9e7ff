"""Monitors share the jobs."""

from pathlib import Path

import pytest
import redis

from plateau.farm.model.job import Job
from plateau.farm.redis import keys
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.until import until

SHORT = {"step": 20, "slice_spp": 10, "max_spp": 40, "rule": {"name": "fixed", "spp": 40}}


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, tmp_path: Path) -> NoiseFarm:
    farm = NoiseFarm(client, redis_url, tmp_path)
    # What is not given back comes back after this test
    farm.settings = farm.settings.model_copy(update={"lease_s": 600.0})
    return farm


def owned(client: redis.Redis, jobs: list[Job]) -> int:
    return sum(client.exists(keys.job(job.id, "owner")) for job in jobs)


def test_each_job_has_one_monitor_and_the_next_as_soon_as_that_one_leaves(
    farm: NoiseFarm, client: redis.Redis
) -> None:
    jobs = [farm.submit(**SHORT) for _ in range(3)]
    with farm.monitor():
        until(lambda: owned(client, jobs) == 3)
        # Given another monitor, which finds all jobs owned
        with farm.monitor():
            jobs += [farm.submit(**SHORT) for _ in range(3)]
            until(lambda: owned(client, jobs) == 6)
        # When it leaves, its jobs are not left alone until a lease runs out
        until(lambda: owned(client, jobs) == 6)
        farm.render(6 * 4)
        until(lambda: all(farm.jobs.get(job.id).finished_at for job in jobs))
    # Each was owned by one at a time: its tokens were given out one after the other
    assert {int(str(client.hget(keys.job(job.id, "sealed"), "fence"))) for job in jobs} <= {1, 2}
