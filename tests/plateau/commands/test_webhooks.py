"""Webhooks on the command line: asked for with a secret that nobody sees, listed, sent again."""

import json
from pathlib import Path

import pytest
import redis
import typer.testing

from plateau.cli import app
from plateau.farm.ledger.outbox import Outbox, new_secret
from tests.support.farms.receiver import OK, receiving
from tests.support.farms.staged_job import StagedJob
from tests.support.scenes.bundles import scene

URL = "https://studio.example/hooks/plateau"


def plateau(*arguments: str) -> tuple[int, str, str]:
    done = typer.testing.CliRunner().invoke(app, arguments)
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done.exit_code, done.stdout, done.stderr


@pytest.fixture(autouse=True)
def _service(api: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLATEAU_URL", api)
    monkeypatch.delenv("PLATEAU_WEBHOOK_SECRET", raising=False)


@pytest.fixture
def box(tmp_path: Path) -> str:
    path = tmp_path / "box.xml"
    path.write_bytes(scene())
    return str(path)


class TestSubmit:
    def test_takes_the_secret_from_the_environment(
        self, box: str, client: redis.Redis, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        secret = new_secret()
        monkeypatch.setenv("PLATEAU_WEBHOOK_SECRET", secret)
        code, out, error = plateau(
            "submit", box, "--webhook", URL, "--webhook-event", "queued", "--json"
        )
        assert code == 0
        assert "waits for a worker" in error  # and nothing more: there is none
        assert len(error.splitlines()) == 1
        assert json.loads(out)["spec"]["webhook"] == {"url": URL, "events": ["queued"]}
        assert secret not in out
        message = Outbox(client).take(30)
        assert message is not None
        assert message.secrets == (secret,)

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            (["--webhook", "studio.example"], "--webhook: must be like https://host/path"),
            (["--webhook", URL, "--webhook-event", "done"], "--webhook-event: "),
            (["--webhook-event", "finished"], "--webhook URL"),
            (["--webhook", "https://127.0.0.1/"], "PLATEAU_WEBHOOK_ALLOW"),
        ],
    )
    def test_says_what_is_wrong(self, box: str, arguments: list[str], words: str) -> None:
        code, out, error = plateau("submit", box, *arguments)
        assert (code, out) == (1, "")
        assert words in error

    def test_does_not_repeat_a_secret_that_is_none(
        self, box: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("PLATEAU_WEBHOOK_SECRET", "swordfish")
        code, _, error = plateau("submit", box, "--webhook", URL)
        assert code == 1
        assert "PLATEAU_WEBHOOK_SECRET: must be whsec_" in error
        assert "swordfish" not in error


@pytest.fixture
def job(client: redis.Redis) -> StagedJob:
    """A job whose first message was refused."""
    job = StagedJob(client, webhook={"url": URL, "events": ("queued", "rendering")})
    job.commit()
    outbox = Outbox(client)
    message = outbox.take(30)
    assert message is not None
    outbox.settle(message, "given-up", status=410, error="the receiver answered 410", took_s=0.1)
    return job


def test_list_shows_each_message(job: StagedJob) -> None:
    code, out, _ = plateau("webhooks", "list", job.id)
    assert code == 0
    first, second = (line.split("\t") for line in out.splitlines())
    assert (first[0], first[1], first[3:6]) == (
        "1",
        "queued",
        ["given-up", "1", "the receiver answered 410"],
    )
    assert (second[0], second[1], second[3:6]) == ("2", "rendering", ["waiting", "0", "–"])
    found = json.loads(plateau("webhooks", "list", job.id, "--json")[1])
    assert [one["state"] for one in found["deliveries"]] == ["given-up", "waiting"]


def test_list_says_where_there_is_no_webhook(client: redis.Redis) -> None:
    code, _, error = plateau("webhooks", "list", StagedJob(client).id)
    assert (code, "the job has no webhook" in error) == (0, True)


def test_show_names_what_is_not_delivered(job: StagedJob) -> None:
    code, out, _ = plateau("show", job.id)
    assert code == 0
    line = next(line for line in out.splitlines() if line.startswith("  1 (queued)"))
    assert "given up after 1 try," in line
    assert "plateau webhooks redeliver" in line
    assert "the receiver answered 410" in line


def test_redeliver_sends_it_again(job: StagedJob, client: redis.Redis) -> None:
    code, out, _ = plateau("webhooks", "redeliver", job.id, "1")
    assert (code, out) == (0, f"msg_{job.id}_1 waiting\n")
    found = {one.number: one.state for one in Outbox(client).deliveries(job.id)}
    assert found[1] == "waiting"
    code, _, error = plateau("webhooks", "redeliver", job.id, "7")
    assert (code, "has no delivery 7" in error) == (1, True)


def test_secret_is_made_once_and_renewed_when_asked(
    client: redis.Redis, redis_url: str, store: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PLATEAU_REDIS_URL", redis_url)
    code, first, _ = plateau("webhooks", "secret")
    assert code == 0
    assert plateau("webhooks", "secret")[1] == first
    assert Outbox(client).farm_secrets() == (first.strip(),)
    code, second, error = plateau("webhooks", "secret", "--renew", "--json")
    assert (code, "for a day" in error) == (0, True)
    assert Outbox(client).farm_secrets() == (json.loads(second)["secret"], first.strip())


class TestNotify:
    def test_tells_whether_a_target_took_a_test_message(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        answers = lambda number, _: OK if number == 1 else (500, {})  # noqa: E731
        with receiving(answers) as receiver:
            file = tmp_path / "targets"
            file.write_text(f"ops {receiver.url.replace('http', 'json', 1)}\n")
            monkeypatch.setenv("PLATEAU_NOTIFY_FILE", str(file))
            assert plateau("notify", "ops") == (0, "ops was notified\n", "")
            code, _, error = plateau("notify", "ops")
        assert (code, "ops was not notified" in error, "500" in error) == (1, True, True)
        code, _, error = plateau("notify", "boss")
        assert (code, "PLATEAU_NOTIFY_FILE names: ops" in error) == (1, True)

    def test_a_job_names_targets(self, box: str) -> None:
        code, _, error = plateau("submit", box, "--notify", "ops")
        assert (code, "there is no target 'ops'" in error) == (1, True)
        code, _, error = plateau("submit", box, "--notify", "https://studio.example")
        assert (code, "--notify: " in error) == (1, True)
