"""Tasks advance side by side, and share round trips to Redis."""

import pytest
import redis

from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Ownership, Ownerships
from plateau.farm.model.errors import FenceLost, JobNotFound
from plateau.farm.model.spec import JobSpec
from plateau.service.monitor.side_by_side import AT_ONCE, SideBySide
from tests.support.redis.round_trips import round_trips


def owned_jobs(client: redis.Redis, count: int) -> list[Ownership]:
    jobs, owners = Jobs(client), Ownerships(client, 60)
    made = [jobs.create(JobSpec(), name="box", scene_sha256="0" * 64).job for _ in range(count)]
    owned = [owners.acquire(job.id) for job in made]
    return [one for one in owned if one is not None]


def test_what_tasks_ask_at_the_same_time_goes_in_one_round_trip(client: redis.Redis) -> None:
    # Given twice as many jobs as have a turn at once, each of which is read and planned twice
    owned, together = owned_jobs(client, 2 * AT_ONCE), SideBySide(client)
    jobs, owners, seen = Jobs(together.client), Ownerships(together.client, 60), []

    def turn(one: Ownership) -> None:
        for stop in (3, 5):
            job = jobs.get(one.job_id)
            owners.plan(one, range(stop))
            seen.append((job.id, stop))

    asked = round_trips(lambda: together.run(lambda it=it: turn(it) for it in owned))  # type: ignore[misc]
    # Then each answer is that of its task, tasks keep their order, and all share eight round trips
    assert sorted(seen) == sorted((one.job_id, stop) for one in owned for stop in (3, 5))
    assert [client.hget(f"plateau:job:{one.job_id}", "planned") for one in owned] == ["5"] * len(
        owned
    )
    assert asked == 2 * 4


def test_an_error_is_that_of_the_task_that_asked(client: redis.Redis) -> None:
    (owned,), together = owned_jobs(client, 1), SideBySide(client)
    jobs, owners, ended = Jobs(together.client), Ownerships(together.client, 60), []

    def fenced() -> None:
        with pytest.raises(FenceLost):
            owners.plan(Ownership(owned.job_id, "another"), range(3))
        ended.append("fenced")

    def missing() -> None:
        with pytest.raises(JobNotFound):
            jobs.get("0" * 12)
        ended.append("missing")

    def well() -> None:
        owners.plan(owned, range(3))
        ended.append(jobs.get(owned.job_id).id)

    together.run([fenced, missing, well])
    assert ended == ["fenced", "missing", owned.job_id]


def test_a_script_that_redis_has_forgotten_is_loaded_again(client: redis.Redis) -> None:
    owned, together = owned_jobs(client, 3), SideBySide(client)
    owners = Ownerships(together.client, 60)
    client.script_flush()
    together.run(lambda it=it: owners.plan(it, range(3)) for it in owned)  # type: ignore[misc]
    assert [client.hget(f"plateau:job:{one.job_id}", "planned") for one in owned] == ["3"] * 3


def test_a_task_that_fails_ends_the_others_where_they_are(client: redis.Redis) -> None:
    owned, together = owned_jobs(client, 1), SideBySide(client)
    jobs, left = Jobs(together.client), []

    def waits() -> None:
        try:
            jobs.get(owned[0].job_id)
            left.append("answered")
        finally:
            left.append("ended")

    def fails() -> None:
        raise RuntimeError("the disk is full")

    with pytest.raises(RuntimeError, match="disk is full"):
        together.run([waits, fails])
    assert left == ["ended"]
    # And others can be run afterwards
    together.run([waits])
    assert left == ["ended", "answered", "ended"]


def test_a_redis_that_is_away_is_an_error_of_each_task(client: redis.Redis) -> None:
    together = SideBySide(client)
    client.close()
    client.connection_pool.connection_kwargs["path"] = "/nowhere"
    errors = []

    def asks() -> None:
        try:
            together.client.ping()
        except redis.exceptions.ConnectionError as error:
            errors.append(error)

    together.run([asks, asks])
    assert len(errors) == 2
