"""The outbox has a notice of each job that is done, and one has it at a time."""

import json
from typing import Any

import pytest
import redis

from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.outbox import Outbox, Taken, retry_delay_s
from plateau.farm.ledger.totals import take_census
from plateau.farm.model.job import Notice
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.redis.commands.sweeps import Forget
from plateau.farm.redis.scripts import Scripts
from tests.support.farms.receiver import SECRET
from tests.support.farms.staged_job import StagedJob

URL = "https://studio.example/hooks/plateau"
STUDIO = "https://studio.example:443"
LEASE_S = 30.0


@pytest.fixture
def outbox(client: redis.Redis) -> Outbox:
    return Outbox(client)


def done(client: redis.Redis, url: str | None = URL, **more: Any) -> StagedJob:
    """A job that is done, whose notice goes there."""
    job = StagedJob(client, notice={"url": url, "secret": SECRET, **more})
    job.commit(2)
    job.point(50, visible=3)
    job.end(JobState.CONVERGED, "for a reason")
    job.finish()
    return job


def taken(outbox: Outbox) -> Taken:
    found = outbox.take(LEASE_S)
    assert found is not None
    return found


def notice(client: redis.Redis, job: StagedJob) -> Notice:
    [found] = Jobs(client).get(job.id).notices
    return found


def time_passes(client: redis.Redis) -> None:
    """Whatever is leased, or is to be tried later, is due."""
    for key in client.scan_iter(f"{keys.NOTICES}*"):
        for one in client.zrange(key, 0, -1):
            client.zadd(key, {one: 1})


def test_it_is_there_once_the_job_is_done(client: redis.Redis, outbox: Outbox) -> None:
    job = StagedJob(client, notice={"url": URL, "secret": SECRET})
    job.commit(4)
    job.end()
    assert Jobs(client).get(job.id).notices == ()
    assert outbox.take(LEASE_S) is None
    job.finish()
    waiting = notice(client, job)
    assert (waiting.to, waiting.state, waiting.error) == (STUDIO, "waiting", None)
    assert outbox.take(LEASE_S) is not None
    assert outbox.take(LEASE_S) is None


def test_who_asks_for_none_has_none(client: redis.Redis, outbox: Outbox) -> None:
    job = done(client, url=None)
    assert Jobs(client).get(job.id).notices == ()
    assert outbox.take(LEASE_S) is None
    assert set(client.hkeys(keys.job(job.id, "sealed"))) <= {"fence"}


def test_a_url_and_each_target_have_their_own(client: redis.Redis, outbox: Outbox) -> None:
    job = done(client, targets=["lead", "ops"])
    found = [taken(outbox) for _ in range(3)]
    assert {one.receiver: one.url for one in found} == {STUDIO: URL, "lead": None, "ops": None}
    outbox.settle(found[0], "delivered")
    states = {one.to: one.state for one in Jobs(client).get(job.id).notices}
    assert states.pop(found[0].receiver) == "delivered"
    assert [*states.values()] == ["waiting", "waiting"]


def test_it_is_leased_to_one_and_comes_back(client: redis.Redis, outbox: Outbox) -> None:
    job = done(client)
    first = taken(outbox)
    assert outbox.take(LEASE_S) is None
    # When its lease runs out, as that of a monitor that was killed, another has it
    time_passes(client)
    again = taken(outbox)
    assert (again.job_id, again.tries) == (first.job_id, 2)
    assert "was lost" in (notice(client, job).error or "")
    # And what the first says of a failure does not count any more
    assert not outbox.settle(first, "failed", "no")
    assert outbox.settle(again, "delivered")
    assert (notice(client, job).state, notice(client, job).error) == ("delivered", None)
    assert not outbox.settle(again, "failed", "no")


def test_who_delivered_it_is_believed_though_his_lease_ran_out(
    client: redis.Redis, outbox: Outbox
) -> None:
    job = done(client)
    late = taken(outbox)
    time_passes(client)
    other = taken(outbox)
    assert outbox.settle(late, "delivered")
    assert not outbox.settle(other, "failed", "no")
    assert notice(client, job).state == "delivered"
    assert outbox.take(LEASE_S) is None
    assert client.exists(keys.NOTICES) == 0


def test_nothing_stays_of_a_job_that_is_forgotten(client: redis.Redis, outbox: Outbox) -> None:
    job = done(client, targets=["ops"])
    held = taken(outbox)
    assert Scripts(client).run(Forget(job=job.id, finished_for_ms=0)) == "forgotten"
    assert not list(client.scan_iter(f"*{job.id}*"))
    assert not list(client.scan_iter(f"{keys.NOTICES}*"))
    # Who was delivering is told that nobody asks any more
    assert not outbox.settle(held, "delivered")
    assert outbox.take(LEASE_S) is None


def test_the_secret_stays_where_no_worker_sees_it(client: redis.Redis, outbox: Outbox) -> None:
    job = done(client)
    assert SECRET not in repr(taken(outbox))
    assert SECRET in client.hvals(keys.job(job.id, "sealed"))
    assert SECRET not in str(client.hgetall(keys.job(job.id)))
    for part in set(keys.JOB_PARTS) - {"sealed"}:
        assert SECRET.encode() not in (client.dump(keys.job(job.id, part)) or b"")
    assert SECRET not in Jobs(client).get(job.id).model_dump_json()


def test_no_worker_can_have_a_notice_sent_elsewhere(client: redis.Redis, outbox: Outbox) -> None:
    # Given a job with a notice
    job = done(client)
    # When somebody who may write the job's hash changes all that it says of it
    spec = json.loads(client.hget(keys.job(job.id), "spec"))
    spec["notice"]["url"] = "https://elsewhere.example/"
    client.hset(keys.job(job.id), "spec", json.dumps(spec))
    # Then it still goes to where its user wanted it
    assert taken(outbox).url == URL


def test_the_totals_count_tries(client: redis.Redis, outbox: Outbox) -> None:
    done(client)
    assert take_census(client).notices_waiting == 1
    outbox.settle(taken(outbox), "failed", "no")
    outbox.settle(taken(outbox), "delivered")
    census = take_census(client)
    assert census.notice_tries == {"delivered": 1, "failed": 1, "given-up": 0}
    assert census.notices_waiting == 0


def test_retries_grow_to_hours_and_end_after_a_day() -> None:
    delays = [retry_delay_s(tries) for tries in range(1, 14)]
    assert 3 < delays[0] < 7
    assert all(delay <= 5 * 3600 for delay in delays)
    assert 18 * 3600 < sum(delays) < 31 * 3600
    # A receiver may ask for more time, but not for ever
    assert retry_delay_s(1, 600) == 600
    assert retry_delay_s(1, 10**9) == 4 * 3600
