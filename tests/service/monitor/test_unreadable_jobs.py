"""A job that cannot be read holds up no other, no monitor, and no list."""

import json
from collections.abc import Callable

import httpx
import pytest
import redis

from plateau.farm.model.errors import JobNotFound
from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from tests.support.api_calls import problem
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.staged_job import StagedJob
from tests.support.until import until

SHORT = {"step": 20, "slice_spp": 10, "max_spp": 40, "rule": {"name": "fixed", "spp": 40}}


def evict(client: redis.Redis, job: Job) -> None:
    client.delete(keys.job(job.id))


def evict_before_a_write(client: redis.Redis, job: Job) -> None:
    """A counter that is written afterwards is no job either."""
    evict(client, job)
    client.hincrby(keys.job(job.id), "machine_ms", 20)


@pytest.mark.parametrize("lose", [evict, evict_before_a_write])
def test_one_that_redis_has_lost_is_dropped_and_the_others_go_on(
    farm: NoiseFarm, client: redis.Redis, lose: Callable[[redis.Redis, Job], None]
) -> None:
    # Given a monitor with two jobs, each of them half rendered and with a slice at a worker
    lost, other = farm.submit(**SHORT, priority=1), farm.submit(**SHORT)
    with farm.monitor():
        farm.render(2)
        until(lambda: farm.jobs.get(lost.id).points == 1)
        held = farm.next_lease()
        assert held.job_id == lost.id
        # When Redis loses one of them
        lose(client, lost)
        # Then the other converges, and nobody has work with the lost one any more
        assert farm.finish(other).state is JobState.CONVERGED
        until(lambda: not client.sismember(keys.UNFINISHED, lost.id))
        assert client.zscore(keys.OPEN, lost.id) is None
        assert [one for one in client.zrange(keys.LEASES, 0, -1) if lost.id in one] == []
        with pytest.raises(JobNotFound):
            farm.jobs.get(lost.id)
        # And the monitor takes new ones
        assert farm.finish(farm.submit(**SHORT)).state is JobState.CONVERGED


def test_one_whose_spec_cannot_be_read_fails_and_the_others_go_on(
    farm: NoiseFarm, client: redis.Redis
) -> None:
    # Given a job with a rule that this Plateau does not know
    odd, other = farm.submit(**SHORT), farm.submit(**SHORT)
    spec = client.hget(keys.job(odd.id), "spec")
    newer = {**json.loads(spec), "rule": {"name": "newer"}}
    client.hset(keys.job(odd.id), "spec", json.dumps(newer))
    with farm.monitor():
        assert farm.finish(other).state is JobState.CONVERGED
        until(lambda: not client.sismember(keys.UNFINISHED, odd.id))
    # Then it has failed, and says why
    client.hset(keys.job(odd.id), "spec", spec)
    done = farm.jobs.get(odd.id)
    assert done.state is JobState.FAILED
    assert "newer" in done.reason


def test_one_that_cannot_even_be_given_up_waits_and_the_others_go_on(
    farm: NoiseFarm, client: redis.Redis, caplog: pytest.LogCaptureFixture
) -> None:
    # Given a job in a state that this Plateau does not know
    odd, other = farm.submit(**SHORT), farm.submit(**SHORT)
    client.hset(keys.job(odd.id), "state", "resting")
    with farm.monitor():
        assert farm.finish(other).state is JobState.CONVERGED
        until(lambda: "neither continue nor fail" in caplog.text)
        # When it can be read again, it goes on too
        client.hset(keys.job(odd.id), "state", "queued")
        assert farm.finish(odd).state is JobState.CONVERGED


def test_one_in_a_state_that_is_unknown_is_left_out_of_lists(
    http: httpx.Client, client: redis.Redis, caplog: pytest.LogCaptureFixture
) -> None:
    # Given two jobs of a batch, one of them in a state that this Plateau does not know
    odd, other = StagedJob(client, batch="exposures"), StagedJob(client, batch="exposures")
    client.hset(keys.job(odd.id), "state", "resting")
    # Then lists have the other, and the API's log says why
    for listed in ("/v1/jobs", "/v1/jobs?batch=exposures"):
        assert [job["id"] for job in http.get(listed).json()["jobs"]] == [other.id]
    assert http.get("/v1/batches/exposures").json()["jobs"] == 1
    (batch,) = http.get("/v1/batches").json()["batches"]
    assert (batch["jobs"], batch["states"]) == (1, {"queued": 1})
    assert f"left out of a list: this Plateau cannot read job {odd.id}" in caplog.text
    # And who asks for it is told why it cannot be shown
    answer = http.get(f"/v1/jobs/{odd.id}")
    assert "'resting'" in problem(answer, 500, "unreadable-job")["detail"]
    # A batch of which nothing is left but a counter is none
    client.delete(keys.job(other.id), keys.job(odd.id))
    client.hincrby(keys.job(odd.id), "machine_ms", 20)
    assert http.get("/v1/jobs").json()["jobs"] == []
    problem(http.get(f"/v1/jobs/{odd.id}"), 500, "unreadable-job")
    assert http.get("/v1/batches").json()["batches"] == []
    problem(http.get("/v1/batches/exposures"), 404, "unknown-batch")
