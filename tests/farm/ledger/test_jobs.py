"""Creating, reading and listing jobs."""

import redis

from plateau.farm.ledger.jobs import Created, Jobs
from plateau.farm.ledger.ownership import Ownerships
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.redis.commands.sweeps import Forget
from plateau.farm.redis.scripts import Scripts
from tests.support.farms.ledger_farm import own
from tests.support.farms.staged_job import StagedJob


def create(jobs: Jobs, **spec: object) -> str:
    return jobs.create(JobSpec(**spec), name="box", scene_sha256="00").job.id


def test_queued_jobs_have_places_by_priority_and_then_by_age(
    jobs: Jobs, client: redis.Redis
) -> None:
    first, last = create(jobs), create(jobs, priority=-3)
    second, urgent, ended = create(jobs), create(jobs, priority=9), create(jobs)
    StagedJob(client, create(jobs, priority=10)).commit()  # which is rendering
    jobs.cancel(ended)
    assert jobs.places() == {urgent: 1, first: 2, second: 3, last: 4}


def test_a_job_has_one_owner_at_a_time(jobs: Jobs, client: redis.Redis) -> None:
    owners = Ownerships(client, lease_s=60)
    owned = own(owners, create(jobs))
    assert owners.acquire(owned.job_id) is None
    owners.disown((owned,))
    assert owners.acquire(owned.job_id) is not None


def test_the_idempotency_key_of_a_job_that_was_forgotten_makes_another(
    jobs: Jobs, client: redis.Redis
) -> None:
    def create_once() -> Created:
        return jobs.create(JobSpec(), name="box", scene_sha256="00", idempotency_key="k")

    # Given a job that was made with a key, ended and was forgotten
    job = StagedJob(client, create_once().job.id)
    job.commit()
    job.end()
    job.finish()
    assert Scripts(client).run(Forget(job=job.id, finished_for_ms=0)) == "forgotten"
    # When the request is repeated, then it makes a new job, once
    new = create_once()
    assert (new.repeated, new.conflict, new.job.state) == (False, False, JobState.QUEUED)
    assert create_once().job.id == new.job.id != job.id
