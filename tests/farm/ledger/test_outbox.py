"""The outbox has a message for each change that a webhook wants, and one has it at a time."""

import json
import time
from typing import Any

import pytest
import redis

from plateau.farm.ledger.continuation import Continuations
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.outbox import Outbox, Taken, new_secret
from plateau.farm.model.job import Job
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.spec.webhook import DEFAULT_EVENTS, WebhookSpec
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.redis.commands.sweeps import Forget
from plateau.farm.redis.scripts import Scripts
from tests.support.farms.staged_job import StagedJob

URL = "https://studio.example/hooks/plateau"
ALL = ("queued", *DEFAULT_EVENTS)
LEASE_S = 30.0


def hook(**more: Any) -> dict[str, Any]:
    return {"webhook": {"url": URL, "events": ALL, **more}}


@pytest.fixture
def outbox(client: redis.Redis) -> Outbox:
    return Outbox(client)


def taken(outbox: Outbox, lease_s: float = LEASE_S, busy: tuple[str, ...] = ()) -> Taken:
    found = outbox.take(lease_s, busy)
    assert found is not None
    return found


def deliver(outbox: Outbox, one: Taken) -> bool:
    return outbox.settle(one, "delivered", status=204, error="", took_s=0.1)


def fail(outbox: Outbox, one: Taken, delay_s: float = 60.0) -> bool:
    return outbox.settle(one, "failed", status=500, error="no", took_s=0.1, delay_s=delay_s)


def test_each_change_of_a_job_is_there_once_and_in_order(
    client: redis.Redis, outbox: Outbox
) -> None:
    job = StagedJob(client, **hook())
    job.commit()
    jobs = Jobs(client)
    jobs.pause(job.id)
    jobs.resume(job.id)
    jobs.resume(job.id)  # nothing happens
    job.point(100, visible=3)
    job.end()
    job.finish()
    told = [one.event for one in outbox.deliveries(job.id)]
    assert told == ["queued", "rendering", "paused", "rendering", "converged", "finished"]
    # Just as the job's events have it
    happened = [one for one in jobs.events(job.id) if one.type in {"state", "finished"}]
    assert told == [one.data.get("to", "finished") for one in happened]


@pytest.mark.parametrize("end", [state for state in JobState if state.ended])
def test_a_message_has_the_job_as_it_was_when_the_script_was_done(
    client: redis.Redis, outbox: Outbox, end: JobState
) -> None:
    job = StagedJob(client, **hook(events=("rendering", end.value)))
    job.commit(2)
    job.point(50, visible=3)
    job.end(end, "for a reason")
    first = taken(outbox)
    assert first.event == "rendering"
    assert (first.job.state, first.job.spp, first.job.ended_at) == (JobState.RENDERING, 0, None)
    assert first.job.started_at is not None
    deliver(outbox, first)
    second = taken(outbox).job
    now = Jobs(client).get(job.id)
    assert second == now
    assert (second.state, second.reason, second.spp) == (end, "for a reason", 50)
    assert second.ended_at is not None


def test_only_what_was_asked_for_is_told(client: redis.Redis, outbox: Outbox) -> None:
    jobs = Jobs(client)
    asked = StagedJob(client, webhook={"url": URL, "events": ("failed", "cancelled")})
    silent = StagedJob(client)
    for job in (asked, silent):
        jobs.cancel(job.id)
    assert [one.event for one in outbox.deliveries(asked.id)] == ["cancelled"]
    assert outbox.deliveries(silent.id) == []
    assert outbox.deliveries("0" * 12) == []


def test_a_delivery_is_leased_to_one_and_comes_back(client: redis.Redis, outbox: Outbox) -> None:
    job = StagedJob(client, **hook())
    first = taken(outbox, lease_s=1.0)
    assert outbox.take(LEASE_S) is None
    [waiting] = outbox.deliveries(job.id)
    assert (waiting.state, waiting.next_try_at) == ("trying", None)
    # When its lease runs out, as that of a monitor that was killed, another has it
    time.sleep(1.0)
    again = taken(outbox)
    assert (again.id, again.number, again.tries) == (first.id, first.number, 2)
    [lost] = outbox.deliveries(job.id)[0].tries
    assert "was lost" in (lost.error or "")
    # And what the first says of a failure does not count any more
    assert not fail(outbox, first)
    assert deliver(outbox, again)
    assert outbox.deliveries(job.id)[0].state == "delivered"
    assert not fail(outbox, again)


def test_who_delivered_it_is_believed_though_his_lease_ran_out(
    client: redis.Redis, outbox: Outbox
) -> None:
    job = StagedJob(client, **hook())
    late = taken(outbox, lease_s=0.05)
    time.sleep(0.1)
    other = taken(outbox)
    assert deliver(outbox, late)
    assert not fail(outbox, other)
    assert outbox.deliveries(job.id)[0].state == "delivered"
    assert outbox.take(LEASE_S) is None
    assert client.exists(keys.RECEIVERS) == 0


def test_of_a_job_one_is_tried_at_a_time_in_order(client: redis.Redis, outbox: Outbox) -> None:
    job = StagedJob(client, **hook())
    other = StagedJob(client, **hook())
    Jobs(client).cancel(job.id)
    first = taken(outbox)
    assert (first.job_id, first.event) == (job.id, "queued")
    # Another job's is not held up by it, its own next one is
    assert taken(outbox).job_id == other.id
    assert outbox.take(LEASE_S) is None
    # One that fails lets the next go before it
    fail(outbox, first)
    assert taken(outbox).event == "cancelled"


def test_what_failed_is_due_later(client: redis.Redis, outbox: Outbox) -> None:
    job = StagedJob(client, **hook())
    fail(outbox, taken(outbox), delay_s=1.0)
    [waiting] = outbox.deliveries(job.id)
    assert waiting.state == "waiting"
    assert waiting.next_try_at is not None
    assert outbox.take(LEASE_S) is None
    time.sleep(1.0)
    second = taken(outbox)
    assert (second.number, second.tries) == (1, 2)
    outbox.settle(second, "given-up", status=410, error="gone", took_s=0.1)
    [given_up] = outbox.deliveries(job.id)
    assert (given_up.state, given_up.next_try_at) == ("given-up", None)
    assert [(one.status, one.error, one.ms) for one in given_up.tries] == [
        (500, "no", 100),
        (410, "gone", 100),
    ]
    assert outbox.take(LEASE_S) is None


def test_a_busy_receiver_is_left_alone(client: redis.Redis, outbox: Outbox) -> None:
    first = StagedJob(client, **hook())
    other = StagedJob(client, webhook={"url": "https://lab.example/x", "events": ("queued",)})
    found = taken(outbox, busy=("https://studio.example:443",))
    assert found.job_id == other.id
    assert found.receiver == "https://lab.example:443"
    assert taken(outbox).job_id == first.id


def test_any_delivery_can_be_made_again(client: redis.Redis, outbox: Outbox) -> None:
    job = StagedJob(client, **hook())
    first = taken(outbox)
    # One that is being tried is left alone
    trying = outbox.redeliver(job.id, 1)
    assert trying is not None
    assert trying.state == "trying"
    assert outbox.take(LEASE_S) is None
    # One that waits is tried at once, and one that was delivered once more
    fail(outbox, first)
    assert outbox.redeliver(job.id, 1) is not None
    second = taken(outbox)
    assert second.tries == 1
    deliver(outbox, second)
    assert outbox.redeliver(job.id, 1) is not None
    assert taken(outbox).id == first.id
    assert outbox.redeliver(job.id, 2) is None
    assert outbox.redeliver("0" * 12, 1) is None


def test_a_job_remembers_a_hundred_messages(client: redis.Redis, outbox: Outbox) -> None:
    job = StagedJob(client, **hook())
    job.commit()
    jobs = Jobs(client)
    for _ in range(60):
        jobs.pause(job.id)
        jobs.resume(job.id)
    found = outbox.deliveries(job.id)
    assert [one.number for one in found] == list(range(23, 123))
    assert jobs.census().webhooks_dropped == 22
    assert jobs.census().webhooks_waiting == 100
    assert client.memory_usage(keys.job(job.id, "deliveries"), samples=0) < 200_000


def test_nothing_stays_of_a_job_that_is_forgotten(client: redis.Redis, outbox: Outbox) -> None:
    job = StagedJob(client, **hook())
    job.commit()
    held = taken(outbox)
    job.point(100, visible=1)
    job.end()
    job.finish()
    assert Scripts(client).run(Forget(job=job.id, finished_for_ms=0)) == "forgotten"
    assert not list(client.scan_iter(f"*{job.id}*"))
    assert set(client.scan_iter(f"{keys.RECEIVERS}*")) <= {keys.WEBHOOK_SECRET}
    # Who was delivering is told that nobody asks any more
    assert not deliver(outbox, held)
    assert outbox.take(LEASE_S) is None


def test_the_secret_stays_in_a_key_of_its_own(client: redis.Redis, outbox: Outbox) -> None:
    secret = new_secret()
    job = StagedJob(client, **hook(secret=secret))
    StagedJob(client, **hook())
    own, other = taken(outbox), taken(outbox)
    assert own.secrets == (secret,)
    assert other.secrets == outbox.farm_secrets() != own.secrets
    assert secret not in repr(own)
    assert client.hget(keys.job(job.id, "webhook"), "secret") == secret
    assert secret not in str(client.hgetall(keys.job(job.id)))
    for part in set(keys.JOB_PARTS) - {"webhook"}:
        assert secret.encode() not in (client.dump(keys.job(job.id, part)) or b"")


def test_no_worker_can_have_a_message_sent_elsewhere(client: redis.Redis, outbox: Outbox) -> None:
    # Given a job with a webhook
    job = StagedJob(client, **hook())
    # When somebody who may write the job's hash changes all that it says of it
    spec = json.loads(client.hget(keys.job(job.id), "spec"))
    spec["webhook"]["url"] = "https://elsewhere.example/"
    client.hset(keys.job(job.id), "spec", json.dumps(spec))
    # Then the message still goes to where its user wanted it
    assert taken(outbox).url == URL


@pytest.mark.parametrize(("url", "same"), [(URL, True), ("https://other.example/x", False)])
def test_a_job_that_goes_on_signs_as_before_for_the_same_receiver(
    client: redis.Redis, outbox: Outbox, url: str, same: bool
) -> None:
    secret = new_secret()
    job = StagedJob(client, keep_slices=True, **hook(events=("finished",), secret=secret))
    job.commit(4)
    job.end()
    job.finish()
    deliver(outbox, taken(outbox))
    # Its spec does not have the secret: nobody is shown it
    old = Jobs(client).get(job.id)
    spec = old.spec.model_copy(update={"webhook": WebhookSpec(url=url)})
    goes_on = Continuations(client)
    new = goes_on.start(old, goes_on.remains(old), spec).job
    message = taken(outbox)
    assert (message.job_id, message.event) == (new.id, "rendering")
    assert message.secrets == ((secret,) if same else outbox.farm_secrets())


def test_for_a_day_the_former_secret_of_the_farm_signs_too(outbox: Outbox) -> None:
    [first] = outbox.farm_secrets()
    second = outbox.renew_farm_secret()
    assert outbox.farm_secrets() == (second, first)
    third = outbox.renew_farm_secret()
    assert outbox.farm_secrets() == (third, second, first)


def test_the_totals_count_tries(client: redis.Redis, outbox: Outbox) -> None:
    StagedJob(client, **hook())
    fail(outbox, taken(outbox), delay_s=0.0)
    deliver(outbox, taken(outbox))
    census = Jobs(client).census()
    assert census.webhook_tries == {"delivered": 1, "failed": 1, "given-up": 0}
    assert census.webhooks_waiting == 0


def test_a_spec_without_a_webhook_leaves_no_trace(client: redis.Redis) -> None:
    job: Job = Jobs(client).get(StagedJob(client).id)
    assert job.spec.webhook is None
    assert not [name for name in client.hgetall(keys.job(job.id)) if name.startswith("webhook")]
    assert job.spec == JobSpec()
