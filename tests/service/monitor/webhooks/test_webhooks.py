"""Deliverers bring each message to its receiver at least once, whoever dies or is silent."""

import io
import logging
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
import redis

from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.outbox import Outbox, new_secret
from plateau.farm.model.deliveries import Delivery
from plateau.farm.model.states import JobState
from plateau.farm.process.addresses import Receivers
from plateau.farm.process.settings import Settings
from plateau.farm.redis import keys
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from plateau.farm.redis.wake import Wake
from plateau.service.monitor.webhooks.deliverers import Deliverer, delivering
from plateau.service.monitor.webhooks.requests import Requests
from tests.support.farms.receiver import OK, SECRET, Receiver, hangs, receiving
from tests.support.farms.staged_job import StagedJob
from tests.support.until import until

HERE = ("127.0.0.0/8",)


class Farm:
    """A Redis, and deliverers that try again soon."""

    def __init__(self, client: redis.Redis, url: str) -> None:
        self.client = client
        self.url = url
        self.outbox = Outbox(client)

    def job(self, receiver: Receiver | str, *events: str, **more: Any) -> StagedJob:
        url = receiver if isinstance(receiver, str) else receiver.url
        hook = {"url": url, "events": events or ("queued",), "secret": SECRET, **more}
        return StagedJob(self.client, webhook=hook)

    def deliverer(self, total_s: float = 30.0, lease_s: float = 30.0) -> Deliverer:
        client = connect(self.url)
        return Deliverer(
            Outbox(client),
            Wake(client, keys.WAKE_WEBHOOKS),
            Requests(Receivers(HERE), connect_s=20.0, total_s=total_s),
            lease_s=lease_s,
            delay_s=lambda _tries, asked_s: max(0.05, asked_s),
            look_s=0.05,
        )

    @contextmanager
    def delivering(self, **how: float) -> Iterator[Deliverer]:
        deliverer = self.deliverer(**how)
        thread = threading.Thread(target=deliverer.run)
        thread.start()
        try:
            yield deliverer
        finally:
            deliverer.stop()
            thread.join()

    def delivery(self, job: StagedJob, number: int = 1) -> Delivery:
        return self.outbox.deliveries(job.id)[number - 1]

    def await_state(self, job: StagedJob, state: str, number: int = 1) -> Delivery:
        until(lambda: self.delivery(job, number).state == state, 60)
        return self.delivery(job, number)


@pytest.fixture
def farm(client: redis.Redis, redis_url: str) -> Farm:
    return Farm(client, redis_url)


def test_a_job_is_told_from_its_start_to_its_results(farm: Farm) -> None:
    with receiving() as receiver, farm.delivering():
        job = farm.job(receiver, "queued", "rendering", "converged", "finished")
        job.commit(4)
        job.point(100, visible=3)
        job.end(JobState.CONVERGED, "levelled off")
        job.finish()
        messages = [one.verified() for one in receiver.wait_for(4)]
    assert [one["type"] for one in messages] == [
        "job.queued",
        "job.rendering",
        "job.converged",
        "job.finished",
    ]
    assert [one["data"]["sequence"] for one in messages] == [1, 2, 3, 4]
    told = messages[2]["data"]["job"]
    assert (told["id"], told["state"], told["reason"]) == (job.id, "converged", "levelled off")
    assert told["spp"] == 100
    assert told["links"]["image_png"] == f"/v1/jobs/{job.id}/image.png"
    assert messages[2]["timestamp"].startswith(told["ended_at"][:19])
    assert "secret" not in told["spec"]["webhook"]
    assert len({one.id for one in receiver.received}) == 4


def test_it_is_tried_again_under_the_same_id_until_it_succeeds(farm: Farm) -> None:
    answers = lambda number, _: (500, {}) if number < 3 else OK  # noqa: E731
    with receiving(answers) as receiver, farm.delivering():
        job = farm.job(receiver)
        done = farm.await_state(job, "delivered")
    assert [one.status for one in done.tries] == [500, 500, 200]
    assert done.tries[0].error == "the receiver answered 500"
    assert done.tries[2].error is None
    assert {one.id for one in receiver.received} == {done.id}
    assert len({one.body for one in receiver.received}) == 1
    for one in receiver.received:
        one.verified()


@pytest.mark.parametrize("status", [301, 302, 307, 308])
def test_a_redirect_is_a_failure_and_is_not_followed(farm: Farm, status: int) -> None:
    with receiving() as private:
        with (
            receiving(lambda *_: (status, {"Location": private.url})) as receiver,
            farm.delivering(),
        ):
            job = farm.job(receiver)
            receiver.wait_for(2)
            until(lambda: len(farm.delivery(job).tries) >= 1)
            assert "redirects are not followed" in (farm.delivery(job).tries[0].error or "")
        assert private.received == []


def test_410_ends_it(farm: Farm) -> None:
    with receiving(lambda *_: (410, {})) as receiver, farm.delivering():
        job = farm.job(receiver)
        assert [one.status for one in farm.await_state(job, "given-up").tries] == [410]
        time.sleep(0.2)
    assert len(receiver.received) == 1


def test_after_its_last_try_it_is_given_up_and_can_be_sent_again(farm: Farm) -> None:
    answers = [503] * 14 + [200]
    with receiving(lambda number, _: (answers[number - 1], {})) as receiver, farm.delivering():
        job = farm.job(receiver)
        assert len(farm.await_state(job, "given-up").tries) == 14
        farm.outbox.redeliver(job.id, 1)
        farm.await_state(job, "delivered")
    assert len({one.id for one in receiver.received}) == 1
    census = Jobs(farm.client).census()
    assert census.webhook_tries == {"delivered": 1, "failed": 13, "given-up": 1}


def test_a_silent_receiver_holds_up_no_other(farm: Farm) -> None:
    goes_on = threading.Event()

    def say_nothing(*_: object) -> tuple[int, dict[str, str]]:
        goes_on.wait(60)
        return OK

    with receiving(say_nothing) as silent, receiving() as other, farm.delivering(total_s=60):
        for _ in range(20):
            farm.job(silent)
        silent.wait_for(2)
        for _ in range(20):
            farm.job(other)
        other.wait_for(20)
        # All of those were told while the first two of these are still being tried
        assert len(silent.received) == 2
        goes_on.set()
        silent.wait_for(20)


def test_of_many_silent_receivers_some_wait(farm: Farm) -> None:
    """Those that did not answer share half of the places, whatever becomes of the others."""
    silent = [f"http://127.0.0.{number}:9/" for number in range(10, 40)]
    with receiving() as other, farm.delivering(total_s=0.5) as deliverer:
        for url in silent:
            farm.job(url)
        until(lambda: len(deliverer._silent) == 30)
        farm.job(other)
        other.wait_for(1)


def test_messages_of_a_job_come_one_after_the_other(farm: Farm) -> None:
    with receiving(hangs(0.1)) as receiver, farm.delivering():
        job = farm.job(receiver, "queued", "rendering", "paused", "cancelled")
        job.commit()
        jobs = Jobs(farm.client)
        for _ in range(3):
            jobs.pause(job.id)
            jobs.resume(job.id)
        jobs.cancel(job.id)
        receiver.wait_for(9)
    assert [one.verified()["data"]["sequence"] for one in receiver.received] == list(range(1, 10))


def test_two_deliverers_share_the_work(farm: Farm) -> None:
    with receiving(hangs(0.05)) as receiver, farm.delivering(), farm.delivering():
        for _ in range(30):
            farm.job(receiver)
        receiver.wait_for(30)
        time.sleep(0.3)
    assert len(receiver.received) == 30
    assert len({one.id for one in receiver.received}) == 30


_MORTAL = """
import sys
from pathlib import Path
sys.path.insert(0, {root!r})
from plateau.farm.redis import keys
from plateau.farm.redis.link import connect
from plateau.farm.redis.wake import Wake
from plateau.farm.ledger.outbox import Outbox
from plateau.farm.process.addresses import Receivers
from plateau.service.monitor.webhooks.requests import Requests
from plateau.service.monitor.webhooks.deliverers import Deliverer

client = connect({url!r})
requests = Requests(Receivers(("127.0.0.0/8",)))
Deliverer(Outbox(client), Wake(client, keys.WAKE_WEBHOOKS), requests, lease_s=1.0).run()
"""


def test_what_a_killed_process_was_delivering_comes_from_another(farm: Farm) -> None:
    root = str(Path(__file__).parents[4])
    killed = threading.Event()

    def answer(number: int, _: object) -> tuple[int, dict[str, str]]:
        if number == 1:
            killed.wait(60)
        return OK

    with receiving(answer) as receiver:
        job = farm.job(receiver)
        script = _MORTAL.format(root=root, url=farm.url)
        with subprocess.Popen([sys.executable, "-c", script]) as process:
            try:
                receiver.wait_for(1)
            finally:
                process.send_signal(signal.SIGKILL)
        assert farm.delivery(job).state == "trying"
        killed.set()
        with farm.delivering():
            done = farm.await_state(job, "delivered")
    # The receiver had it twice, and can tell by its id
    assert [one.id for one in receiver.received] == [done.id, done.id]
    assert receiver.received[0].body == receiver.received[1].body
    assert "was lost" in (done.tries[0].error or "")


def test_one_that_stops_waits_a_moment_for_what_is_under_way(farm: Farm) -> None:
    with receiving(hangs(0.5)) as receiver:
        with farm.delivering():
            job = farm.job(receiver)
            receiver.wait_for(1)
        assert farm.delivery(job).state == "delivered"


def test_a_deliverer_outlives_redis(tmp_path: Path) -> None:
    first = EmbeddedRedis(tmp_path)
    with receiving() as receiver, connect(first.url) as client:
        farm = Farm(client, first.url)
        with farm.delivering():
            farm.job(receiver)
            receiver.wait_for(1)
            os.kill(first.process.pid, signal.SIGKILL)
            first.process.wait()
            time.sleep(0.5)
            second = EmbeddedRedis(tmp_path)
            try:
                assert second.url == first.url
                farm.job(receiver)
                receiver.wait_for(2)
            finally:
                second.stop()


def test_neither_secret_nor_path_is_in_a_log(farm: Farm, redis_url: str) -> None:
    written = io.StringIO()
    handler = logging.StreamHandler(written)
    logging.getLogger().addHandler(handler)
    level = logging.getLogger().level
    logging.getLogger().setLevel(logging.DEBUG)
    try:
        with receiving(lambda number, _: (500, {}) if number == 1 else OK) as receiver:
            secret = new_secret()
            job = farm.job(f"{receiver.url}&token=swordfish", secret=secret)
            with farm.delivering():
                farm.await_state(job, "delivered")
            receiver.received[1].verified(secret)
    finally:
        logging.getLogger().removeHandler(handler)
        logging.getLogger().setLevel(level)
    lines = written.getvalue()
    assert f"webhook msg_{job.id}_1 (queued)" in lines
    assert "try 2 follows" in lines
    assert "delivered by try 2" in lines
    for hidden in (secret, secret[6:], "swordfish", "/hook"):
        assert hidden not in lines


def test_a_monitor_s_deliverers_obey_the_setting(farm: Farm, redis_url: str) -> None:
    with receiving() as receiver:
        with delivering(Settings(redis_url=redis_url)):
            refused = farm.job(receiver)
            until(lambda: farm.delivery(refused).tries)
        assert "no public address" in (farm.delivery(refused).tries[0].error or "")
        assert receiver.received == []
        with delivering(Settings(redis_url=redis_url, webhook_allow=HERE)):
            allowed = farm.job(receiver)
            farm.await_state(allowed, "delivered")


def test_the_receiver_of_the_docs_takes_a_message(farm: Farm, tmp_path: Path) -> None:
    page = (Path(__file__).parents[4] / "docs" / "notices.md").read_text()
    [code] = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    said = tmp_path / "said"
    with (
        said.open("wb") as out,
        subprocess.Popen(
            [sys.executable, "-c", code.replace("8000", str(port))],
            env={**os.environ, "PLATEAU_WEBHOOK_SECRET": SECRET},
            stdout=out,
            stderr=subprocess.DEVNULL,
        ) as process,
        farm.delivering(),
    ):
        try:
            job = farm.job(f"http://127.0.0.1:{port}/")
            assert farm.await_state(job, "delivered").tries[-1].status == 204
            forged = httpx.post(f"http://127.0.0.1:{port}/", json={}, trust_env=False, timeout=60)
        except httpx.RemoteProtocolError:  # the library raised, and so nothing was answered
            forged = None
        finally:
            process.terminate()
    assert forged is None
    assert said.read_text().split() == ["job.queued", job.id]


def test_without_a_secret_the_farm_s_own_signs(farm: Farm) -> None:
    with receiving() as receiver, farm.delivering():
        farm.job(receiver, secret=None)
        receiver.wait_for(1)[0].verified(farm.outbox.farm_secrets()[0])
