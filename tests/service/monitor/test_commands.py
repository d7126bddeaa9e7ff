"""Commands that the operator allows are started at jobs' ends, whatever becomes of monitors."""

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
import redis

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.outbox import Outbox
from plateau.farm.model.states import JobState
from plateau.farm.process.addresses import Receivers
from plateau.farm.process.allowed_commands import AllowedCommands, BadCommands, read_commands
from plateau.farm.process.settings import Settings
from plateau.farm.redis import keys
from plateau.farm.redis.link import connect
from plateau.farm.redis.wake import Wake
from plateau.farm.wire.examples import SCENE_XML
from plateau.service.monitor.webhooks.commands import Commands
from plateau.service.monitor.webhooks.deliverers import Deliverer
from plateau.service.monitor.webhooks.requests import Requests
from plateau.terminal.story import story
from tests.service.monitor.webhooks.test_notifications import ended, state
from tests.support.farms.live_api import live_api
from tests.support.farms.staged_job import StagedJob
from tests.support.until import until

PYTHON = sys.executable


def script(text: str) -> tuple[str, ...]:
    """A command of Python's, which may import nothing of Plateau's by chance."""
    return (PYTHON, "-I", "-c", text)


def deliverer(url: str, words: Mapping[str, tuple[str, ...]], **options: float) -> Deliverer:
    client = connect(url)
    limit_s, lease_s = options.get("limit_s", 60.0), options.get("lease_s", 30.0)
    return Deliverer(
        Outbox(client),
        Wake(client, keys.WAKE_WEBHOOKS),
        Requests(Receivers(())),
        commands=Commands(AllowedCommands(words, limit_s), "https://farm/"),
        lease_s=lease_s,
        delay_s=lambda *_: 0.05,
        look_s=0.05,
    )


@contextmanager
def starting(url: str, words: Mapping[str, tuple[str, ...]], **options: float) -> Iterator[None]:
    one = deliverer(url, words, **options)
    thread = threading.Thread(target=one.run)
    thread.start()
    try:
        yield
    finally:
        one.stop()
        thread.join()


def told(client: redis.Redis, job: StagedJob) -> list[dict[str, Any]]:
    """What the job's events say of its commands."""
    return [one.data for one in Jobs(client).events(job.id) if one.type == "command"]


def test_a_command_is_given_the_facts_and_no_secrets(
    client: redis.Redis, redis_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret")
    monkeypatch.setenv("PLATEAU_REDIS_URL", redis_url)
    tells = f"""
import json, os, sys
facts = {{"in": json.load(sys.stdin), "env": dict(os.environ)}}
facts |= {{"words": sys.argv[1:], "here": os.getcwd()}}
open({str(tmp_path / "facts")!r}, "w").write(json.dumps(facts))
print("first", flush=True); print("made a movie", file=sys.stderr)
"""
    words = {"movie": (*script(tells), "$HOME", "; exit 3")}
    with starting(redis_url, words):
        job = ended(client, then=["movie"])
        until(lambda: told(client, job), 60)
    facts = json.loads((tmp_path / "facts").read_text())
    assert facts["in"]["type"] == "job.finished"
    assert facts["in"]["data"]["job"]["id"] == facts["env"]["PLATEAU_JOB_ID"] == job.id
    assert facts["in"]["batch"] is None
    ours = {name: text for name, text in facts["env"].items() if name.startswith("PLATEAU_")}
    assert ours == {
        "PLATEAU_JOB_ID": job.id,
        "PLATEAU_JOB_NAME": "box",
        "PLATEAU_JOB_STATE": "converged",
        "PLATEAU_JOB_REASON": "levelled off",
        "PLATEAU_JOB_SPP": "100",
        "PLATEAU_JOB_BATCH": "",
        "PLATEAU_BATCH_DONE": "",
        "PLATEAU_MESSAGE_ID": f"msg_{job.id}_1",
        "PLATEAU_TRY": "1",
        "PLATEAU_URL": "https://farm/",
    }
    assert "AWS_SECRET_ACCESS_KEY" not in facts["env"]
    # No shell has seen its words, and its folder went with it
    assert facts["words"] == ["$HOME", "; exit 3"]
    assert not Path(facts["here"]).exists()
    # Its end is an event, a line of the story, and a delivery
    assert told(client, job) == [{"name": "movie", "exit_code": 0, "words": "made a movie"}]
    lines = story(job.id, Jobs(client).events(job.id), ())
    assert lines[-1].endswith("command movie: exit code 0: made a movie")
    [one] = Outbox(client).deliveries(job.id)
    assert (one.command, one.target, one.state, one.tries[0].status) == (
        *("movie", None, "delivered"),
        0,
    )


@pytest.mark.long
def test_one_that_fails_or_takes_too_long_is_not_run_again(
    client: redis.Redis, redis_url: str, tmp_path: Path
) -> None:
    ran = tmp_path / "ran"
    fails = script(f"open({str(ran)!r}, 'a').write('x'); print('no codec'); raise SystemExit(3)")
    child = tmp_path / "child"
    sleeps = script(
        f"import subprocess, sys, time; p = subprocess.Popen(['sleep', '600']); "
        f"open({str(child)!r}, 'w').write(str(p.pid)); time.sleep(600)"
    )
    with starting(redis_url, {"fails": fails, "sleeps": sleeps}, limit_s=3.0):
        job = ended(client, JobState.FAILED, then=["fails", "sleeps"])
        until(lambda: len(told(client, job)) == 2, 60)
        assert [state(client, job, number) for number in (1, 2)] == ["given-up"] * 2
    by_name = {one["name"]: (one.get("exit_code"), one["words"]) for one in told(client, job)}
    assert by_name == {
        "fails": (3, "no codec"),
        "sleeps": (None, "it was ended after 3 s"),
    }
    # What it has started has ended with it
    until(lambda: not Path(f"/proc/{child.read_text()}").exists(), 20)
    # Until somebody asks for it
    with starting(redis_url, {"fails": fails}):
        Outbox(client).redeliver(job.id, 1)
        until(lambda: len(told(client, job)) == 3, 60)
    assert ran.read_text() == "xx"


def test_a_batch_says_with_which_job_it_is_done(
    client: redis.Redis, redis_url: str, tmp_path: Path
) -> None:
    file = tmp_path / "file"
    writes = script(
        f"import json, os, sys; open({str(file)!r}, 'a').write("
        "os.environ['PLATEAU_BATCH_DONE'] + json.dumps(json.load(sys.stdin)['batch']) + '\\n')"
    )
    with starting(redis_url, {"movie": writes}):
        frames = [StagedJob(client, batch="walk", then=["movie"]) for _ in range(2)]
        for frame in frames:
            frame.end(JobState.CANCELLED, "enough")
            frame.finish()
            until(lambda: told(client, frame), 60)  # noqa: B023
    assert file.read_text().splitlines() == ["null", '1{"cancelled": 2}']


def test_one_that_its_monitor_cannot_start_is_left_to_another(
    client: redis.Redis, redis_url: str, tmp_path: Path
) -> None:
    missing = {"movie": (str(tmp_path / "missing"),)}
    with starting(redis_url, missing):
        job = ended(client, then=["movie"])
        until(lambda: Outbox(client).deliveries(job.id)[0].tries, 60)
    [first, *_] = Outbox(client).deliveries(job.id)[0].tries
    assert (
        first.error
        == f"for this monitor, {missing['movie'][0]} cannot be started: No such file or directory"
    )
    with starting(redis_url, {}):
        tries = len(Outbox(client).deliveries(job.id)[0].tries)
        until(lambda: len(Outbox(client).deliveries(job.id)[0].tries) > tries, 60)
    assert told(client, job) == []
    with starting(redis_url, {"movie": script("")}):
        until(lambda: told(client, job), 60)
    assert told(client, job) == [{"name": "movie", "exit_code": 0, "words": ""}]


#: A monitor's deliverer in a process of its own: its Redis, and the words of its command as JSON.
MONITOR = """
import json, sys
from tests.service.monitor.test_commands import deliverer
deliverer(sys.argv[1], {"movie": tuple(json.loads(sys.argv[2]))}, lease_s=1.5).run()
"""


def test_a_killed_monitor_takes_its_command_along_and_another_runs_it_again(
    client: redis.Redis, redis_url: str, tmp_path: Path
) -> None:
    file = tmp_path / "pids"
    waits = script(
        f"import os, time; open({str(file)!r}, 'a').write("
        "f\"{os.getpid()} {os.environ['PLATEAU_TRY']}\\n\"); "
        "time.sleep(600 if os.environ['PLATEAU_TRY'] == '1' else 0); print('done')"
    )
    monitor = subprocess.Popen([PYTHON, "-c", MONITOR, redis_url, json.dumps(waits)])
    try:
        job = ended(client, then=["movie"])
        until(lambda: file.exists() and file.read_text().endswith("\n"), 60)
        first = file.read_text().split()[0]
        # While it runs its lease is kept, beyond its length, so nobody else starts it
        due = float(client.zscore(keys.webhooks_due("then:movie"), f"{job.id}:1"))
        until(
            lambda: float(client.zscore(keys.webhooks_due("then:movie"), f"{job.id}:1")) > due, 60
        )
        assert Outbox(client).take(1.5) is None
        # When the monitor is killed, so is the command
        monitor.send_signal(signal.SIGKILL)
        monitor.wait()
        until(lambda: not Path(f"/proc/{first}").exists(), 20)
        assert told(client, job) == []
        # And another monitor runs it again, when the lease is over
        with starting(redis_url, {"movie": waits}):
            until(lambda: told(client, job), 60)
    finally:
        monitor.kill()
        monitor.wait()
    assert [line.split()[1] for line in file.read_text().splitlines()] == ["1", "2"]
    assert told(client, job) == [{"name": "movie", "exit_code": 0, "words": "done"}]
    [one] = Outbox(client).deliveries(job.id)
    assert one.tries[0].error == "the monitor that tried it was lost, or was cut off from Redis"


def test_a_stopping_monitor_ends_its_command_and_leaves_it_to_another(
    client: redis.Redis, redis_url: str, tmp_path: Path
) -> None:
    file = tmp_path / "pid"
    sleeps = script(
        f"import os, time; open({str(file)!r}, 'w').write(f'{{os.getpid()}}.'); time.sleep(600)"
    )
    with starting(redis_url, {"movie": sleeps}):
        job = ended(client, then=["movie"])
        until(lambda: file.exists() and file.read_text().endswith("."), 60)
    assert not Path(f"/proc/{file.read_text()[:-1]}").exists()
    with starting(redis_url, {"movie": script("")}):
        until(lambda: told(client, job), 60)
    tries = Outbox(client).deliveries(job.id)[0].tries
    assert [one.error for one in tries] == [
        "for this monitor, it was ended: the monitor stops",
        None,
    ]


class TestTheFile:
    def test_has_names_and_commands_without_a_shell(self, tmp_path: Path) -> None:
        file = tmp_path / "commands"
        file.write_text(
            "# of the studio\n\nmovie /opt/movie --codec 'h 264' $HOME\ncomp  nuke -t\n"
        )
        found = read_commands(Settings(commands_file=file, command_limit_s=9))
        assert found.words == {
            "movie": ("/opt/movie", "--codec", "h 264", "$HOME"),
            "comp": ("nuke", "-t"),
        }
        assert found.limit_s == 9
        assert read_commands(Settings()).words == {}

    @pytest.mark.parametrize("line", ["movie", "a,b ls", "movie 'ls", "ok ls\nok ls"])
    def test_a_wrong_line_is_refused(self, tmp_path: Path, line: str) -> None:
        file = tmp_path / "commands"
        file.write_text(line)
        with pytest.raises(BadCommands, match="must be a new name, a blank and a command"):
            read_commands(Settings(commands_file=file))
        with pytest.raises(BadCommands, match="cannot be read"):
            read_commands(Settings(commands_file=tmp_path / "none"))


def test_the_api_refuses_commands_that_the_operator_does_not_name(
    client: redis.Redis, redis_url: str, api_store: Blobs
) -> None:
    allowed = AllowedCommands({"movie": ("true",)})
    with (
        live_api(redis_url, api_store, commands=allowed) as url,
        httpx.Client(base_url=url, trust_env=False) as http,
    ):
        scene = {"scene": ("a.xml", SCENE_XML)}
        made = http.post("/v1/jobs", files=scene, data={"spec": '{"then": ["movie"]}'})
        assert made.json()["spec"]["then"] == ["movie"]
        answer = http.post("/v1/jobs", files=scene, data={"spec": '{"then": ["rm -rf"]}'})
        assert answer.status_code == 422
        answer = http.post("/v1/jobs", files=scene, data={"spec": '{"then": ["comp"]}'})
        words = "spec.then: there is no command 'comp'; PLATEAU_COMMANDS_FILE names: movie"
        assert (answer.status_code, answer.json()["detail"]) == (422, words)
        # A stream ends with `finished`, although the events of commands come after it
        job = ended(client, then=["movie"])
        with starting(redis_url, {"movie": script("")}):
            until(lambda: told(client, job), 60)
        events = http.get(f"/v1/jobs/{job.id}/events", headers={"Accept": "application/json"})
        *_, finished, command = events.json()["events"]
        assert (finished["type"], command["type"]) == ("finished", "command")
        resumed = {"Last-Event-ID": finished["id"]}
        assert http.get(f"/v1/jobs/{job.id}/events", headers=resumed).status_code == 204
