"""Notices on the command line: asked for with a secret that nobody sees, shown, and tested."""

import json
from pathlib import Path

import pytest
import redis

from plateau.farm.ledger.outbox import Outbox
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from tests.support.farms.receiver import OK, SECRET, receiving
from tests.support.farms.staged_job import StagedJob
from tests.support.processes.commands import plateau

URL = "https://studio.example/hooks/plateau"


@pytest.fixture(autouse=True)
def _no_secret(_service: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PLATEAU_WEBHOOK_SECRET", raising=False)


class TestSubmit:
    def test_takes_the_secret_from_the_environment(
        self, box: str, client: redis.Redis, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("PLATEAU_WEBHOOK_SECRET", SECRET)
        code, out, error = plateau("submit", box, "--notify", URL, "--json")
        assert code == 0
        assert "waits for a worker" in error  # and nothing more: there is none
        assert len(error.splitlines()) == 1
        job = json.loads(out)
        assert job["spec"]["notice"] == {"url": URL, "targets": []}
        assert SECRET not in out
        assert client.hget(keys.job(job["id"], "sealed"), "notice_secret") == SECRET

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            (["studio.example/hook"], "--notify: must be like https://host/path"),
            (["https://127.0.0.1/"], "PLATEAU_WEBHOOK_ALLOW"),
            ([URL, "https://lab.example/"], "--notify: a job has one URL"),
            (["ops"], "there is no target 'ops'"),
            (["rm -rf"], "--notify: "),
        ],
    )
    def test_says_what_is_wrong(
        self, box: str, arguments: list[str], words: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("PLATEAU_WEBHOOK_SECRET", SECRET)
        told = [word for one in arguments for word in ("--notify", one)]
        code, out, error = plateau("submit", box, *told)
        assert (code, out) == (1, "")
        assert words in error

    def test_asks_for_a_secret_and_does_not_repeat_one_that_is_none(
        self, box: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        code, _, error = plateau("submit", box, "--notify", URL)
        assert (code, "export PLATEAU_WEBHOOK_SECRET=whsec_$(openssl" in error) == (1, True)
        monkeypatch.setenv("PLATEAU_WEBHOOK_SECRET", "swordfish")
        code, _, error = plateau("submit", box, "--notify", URL)
        assert code == 1
        assert "PLATEAU_WEBHOOK_SECRET: must be whsec_" in error
        assert "swordfish" not in error


def test_show_names_what_is_not_delivered(client: redis.Redis) -> None:
    job = StagedJob(client, notice={"url": URL, "secret": SECRET})
    job.end(JobState.CANCELLED, "not needed")
    job.finish()

    def shown() -> list[str]:
        code, out, _ = plateau("show", job.id)
        assert code == 0
        return [line for line in out.splitlines() if line.startswith("notice")]

    [line] = shown()
    assert "to https://studio.example:443, not delivered yet" in line
    taken = Outbox(client).take(30)
    assert taken is not None
    Outbox(client).settle(taken, "given-up", "the receiver answered 410")
    [line] = shown()
    assert "given up at" in line
    assert line.endswith("UTC: the receiver answered 410")


def test_doctor_tells_whether_a_target_took_a_test_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = lambda number, _: OK if number == 1 else (500, {})  # noqa: E731
    with receiving(answers) as receiver:
        file = tmp_path / "targets"
        file.write_text(f"ops {receiver.url.replace('http', 'json', 1)}&cto=120&rto=120\n")
        monkeypatch.setenv("PLATEAU_NOTIFY_FILE", str(file))
        assert plateau("doctor", "--notify", "ops") == (0, "ops was notified\n", "")
        code, _, error = plateau("doctor", "--notify", "ops")
    assert (code, "ops was not notified" in error, "500" in error) == (1, True, True)
    code, _, error = plateau("doctor", "--notify", "boss")
    assert (code, "PLATEAU_NOTIFY_FILE names: ops" in error) == (1, True)
