"""Notifiers bring each notice to its receiver at least once, whoever dies or is silent."""

import logging
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest
import redis

from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.totals import take_census
from plateau.farm.model.job import Notice
from plateau.farm.model.states import JobState
from plateau.farm.process.settings import Settings
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from plateau.service.monitor.notifier.notes import Notes
from plateau.service.monitor.notifier.notifier import Notifier, notifying
from plateau.service.monitor.notifier.requests import Requests
from plateau.service.notices.receivers import Receivers
from tests.service.monitor.notifier.test_notes import notifying as trying_soon
from tests.support.farms.receiver import OK, SECRET, Receiver, receiving
from tests.support.farms.staged_job import StagedJob
from tests.support.until import until

HERE = ("127.0.0.0/8",)


class Farm:
    """A Redis, and notifiers that try again soon."""

    def __init__(self, client: redis.Redis, url: str) -> None:
        self.client = client
        self.url = url

    def job(self, receiver: Receiver | str) -> StagedJob:
        """A job that is done, whose notice goes there."""
        url = receiver if isinstance(receiver, str) else receiver.url
        job = StagedJob(self.client, notice={"url": url, "secret": SECRET})
        job.end(JobState.CANCELLED, "not needed")
        job.finish()
        return job

    @contextmanager
    def notifying(self, total_s: float = 30.0) -> Iterator[Notifier]:
        requests = Requests(Receivers(HERE), connect_s=20.0, total_s=total_s)
        with trying_soon(self.url, Notes(), requests) as notifier:
            yield notifier

    def notice(self, job: StagedJob) -> Notice:
        [found] = Jobs(self.client).get(job.id).notices
        return found

    def await_state(self, job: StagedJob, state: str) -> Notice:
        until(lambda: self.notice(job).state == state)
        return self.notice(job)


@pytest.fixture
def farm(client: redis.Redis, redis_url: str) -> Farm:
    return Farm(client, redis_url)


def test_a_job_is_told_of_with_its_results(farm: Farm) -> None:
    with receiving() as receiver, farm.notifying():
        job = StagedJob(farm.client, notice={"url": receiver.url, "secret": SECRET})
        job.commit(4)
        job.point(100, visible=3)
        job.end(JobState.CONVERGED, "levelled off")
        job.finish()
        [message] = [one.verified() for one in receiver.wait_for(1)]
        farm.await_state(job, "delivered")
    told = message["data"]["job"]
    assert message["type"] == "job.finished"
    assert message["timestamp"] == told["finished_at"]
    assert (told["id"], told["state"], told["reason"]) == (job.id, "converged", "levelled off")
    assert told["spp"] == 100
    assert told["links"]["image_png"] == f"/v1/jobs/{job.id}/image.png"
    assert told["spec"]["notice"]["url"] == f"{receiver.url.partition('/hook')[0]}/..."
    assert "secret" not in told["spec"]["notice"]
    assert receiver.received[0].id == f"msg_{job.id}"


def test_it_is_tried_again_under_the_same_id_until_it_succeeds(farm: Farm) -> None:
    answers = lambda number, _: (500, {}) if number < 3 else OK  # noqa: E731
    with receiving(answers) as receiver, farm.notifying():
        job = farm.job(receiver)
        assert farm.await_state(job, "delivered").error is None
    assert [one.id for one in receiver.received] == [f"msg_{job.id}"] * 3
    assert len({one.body for one in receiver.received}) == 1
    for one in receiver.received:
        one.verified()


@pytest.mark.parametrize("status", [301, 307])
def test_a_redirect_is_a_failure_and_is_not_followed(farm: Farm, status: int) -> None:
    with receiving() as private:
        with (
            receiving(lambda *_: (status, {"Location": private.url})) as receiver,
            farm.notifying(),
        ):
            job = farm.job(receiver)
            receiver.wait_for(2)
            until(lambda: "redirects are not followed" in (farm.notice(job).error or ""))
        assert private.received == []


@pytest.mark.parametrize(("status", "tries"), [(410, 1), (503, 14)])
def test_after_its_last_try_it_is_given_up(farm: Farm, status: int, tries: int) -> None:
    # By two notifiers, which share the work
    with receiving(lambda *_: (status, {})) as receiver, farm.notifying(), farm.notifying():
        job = farm.job(receiver)
        assert farm.await_state(job, "given-up").error == f"the receiver answered {status}"
    assert len(receiver.received) == tries
    census = take_census(farm.client)
    assert census.notice_tries == {"delivered": 0, "failed": tries - 1, "given-up": 1}


def test_a_silent_receiver_holds_up_no_other(farm: Farm) -> None:
    goes_on = threading.Event()

    def say_nothing(*_: object) -> tuple[int, dict[str, str]]:
        goes_on.wait(60)
        return OK

    with receiving(say_nothing) as silent, receiving() as other, farm.notifying(total_s=60):
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


def test_one_that_stops_waits_a_moment_for_what_is_under_way(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("plateau.service.monitor.notifier.notifier._GOODBYE_S", 120.0)
    stops = threading.Event()

    def answer(*_: object) -> tuple[int, dict[str, str]]:
        stops.wait(60)
        return OK

    with receiving(answer) as receiver:
        with farm.notifying() as notifier:
            job = farm.job(receiver)
            receiver.wait_for(1)
            threading.Timer(0.5, stops.set).start()
            notifier.stop()
        assert farm.notice(job).state == "delivered"


def test_a_notifier_outlives_redis(tmp_path: Path) -> None:
    first = EmbeddedRedis(tmp_path)
    with receiving() as receiver, connect(first.url, 120.0) as client:
        farm = Farm(client, first.url)
        with farm.notifying():
            farm.job(receiver)
            receiver.wait_for(1)
            os.kill(first.process.pid, signal.SIGKILL)
            first.process.wait()
            second = EmbeddedRedis(tmp_path)
            try:
                assert second.url == first.url
                farm.job(receiver)
                receiver.wait_for(2)
            finally:
                second.stop()


def test_neither_secret_nor_path_is_in_a_log(farm: Farm, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG)
    with receiving(lambda number, _: (500, {}) if number == 1 else OK) as receiver:
        job = farm.job(f"{receiver.url}&token=swordfish")
        with farm.notifying():
            farm.await_state(job, "delivered")
        receiver.received[1].verified()
    lines = caplog.text
    assert f"the notice of job {job.id} to http://127.0.0.1:" in lines
    assert "try 2 follows" in lines
    assert "delivered by try 2" in lines
    for hidden in (SECRET[6:], "swordfish", "/hook"):
        assert hidden not in lines


def test_a_monitor_s_notifier_obeys_the_setting(farm: Farm, redis_url: str) -> None:
    with receiving() as receiver:
        with notifying(Settings(redis_url=redis_url)):
            refused = farm.job(receiver)
            until(lambda: "no public address" in (farm.notice(refused).error or ""))
        assert receiver.received == []
        with notifying(Settings(redis_url=redis_url, webhook_allow=HERE)):
            allowed = farm.job(receiver)
            farm.await_state(allowed, "delivered")


def test_the_receiver_of_the_docs_takes_a_message(farm: Farm) -> None:
    page = (Path(__file__).parents[4] / "docs" / "notices.md").read_text()
    [code] = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    served = 'HTTPServer(("", 8000), Receiver).serve_forever()'
    assert served in code
    anywhere = 'server = HTTPServer(("127.0.0.1", 0), Receiver)\n'
    anywhere += "print(server.server_port, flush=True)\nserver.serve_forever()"
    with (
        subprocess.Popen(
            [sys.executable, "-c", code.replace(served, anywhere)],
            env={**os.environ, "PLATEAU_WEBHOOK_SECRET": SECRET},
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        ) as process,
        farm.notifying(),
    ):
        assert process.stdout is not None
        try:
            url = f"http://127.0.0.1:{int(process.stdout.readline())}/"
            job = farm.job(url)
            farm.await_state(job, "delivered")
            with pytest.raises(httpx.RemoteProtocolError):  # the library raises at a forged one
                httpx.post(url, json={}, trust_env=False, timeout=60)
        finally:
            process.terminate()
        assert process.stdout.read().split() == ["job.finished", job.id]
