"""What processes log: in both formats, each line with who wrote it and what it is about."""

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import httpx
import pytest
import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.model.states import JobState
from tests.support.farms.bench import SCENE, Bench
from tests.support.long_tests import rare
from tests.support.processes.commands import Command, starting
from tests.support.until import until

Run = Callable[..., Command]


@pytest.fixture
def bench(client: redis.Redis, redis_url: str, store: Blobs, tmp_path: Path) -> Bench:
    return Bench(client, redis_url, store, tmp_path)


@pytest.fixture
def run(redis_url: str, store: Blobs, tmp_path: Path, cache: Path) -> Iterator[Run]:
    def start(*arguments: str, log_format: str = "json", **environment: str) -> Command:
        settings = {
            "PLATEAU_REDIS_URL": redis_url,
            "PLATEAU_BLOBS": store.where,
            "PLATEAU_CACHE": str(cache),
            "PLATEAU_LOG_FORMAT": log_format,
            **environment,
        }
        return Command(*arguments, folder=tmp_path, **settings)

    yield from starting(start)


def lines(command: Command) -> list[dict[str, Any]]:
    """Every line that the process wrote, each an object that says when, how bad, what and who."""
    parsed = [json.loads(line) for line in command.said.splitlines()]
    for line in parsed:
        at = datetime.fromisoformat(line["time"].replace("Z", "+00:00"))
        assert abs(datetime.now(timezone.utc) - at).total_seconds() < 300
        assert line["level"] in {"info", "warning", "error", "critical"}
        assert line["message"]
        assert line["role"]
    return parsed


def about(found: list[dict[str, Any]], words: str) -> set[tuple[str | None, int | None]]:
    """The jobs and slices of the lines whose message has these words."""
    return {(one.get("job"), one.get("slice")) for one in found if words in one["message"]}


def test_every_line_of_a_worker_says_which_job_and_slice_it_is_about(
    bench: Bench, run: Run
) -> None:
    wrong = SCENE.format(integrator="path").replace('"diffuse"', '"nosuchplugin"')
    broken, _ = bench.job(slices=1, scene=wrong)
    worker = run("worker")
    until(lambda: bench.jobs.get(broken.id).state is JobState.FAILED, 120)
    # Given a blob store that takes nothing for a while
    folder = Path(bench.store.where) / "jobs"
    folder.touch()
    good, _ = bench.job(slices=1)
    worker.wait_for("the slice waits")
    folder.unlink()
    until(lambda: len(bench.jobs.ledger(good.id)) == 1)
    worker.process.send_signal(signal.SIGTERM)
    assert worker.exit_code() == 0
    # Then whatever it wrote meanwhile, from whichever thread, has its fields
    found = lines(worker)
    (entry,) = bench.jobs.log(good.id)
    assert {one["role"] for one in found} == {"worker"}
    assert {one["worker"] for one in found} == {entry.worker}
    assert about(found, "nosuchplugin") == {(broken.id, 0)}
    assert about(found, "the slice waits") == {(good.id, 0)}
    # And nothing else that it wrote is about them
    assert about(found, "renders here") == {(None, None)}


def test_every_line_of_a_monitor_says_which_job_and_slice_it_is_about(
    bench: Bench, run: Run
) -> None:
    # Given a job whose first partial was lost
    job, owned = bench.job(slices=1)
    with bench.worker():
        until(lambda: len(bench.jobs.ledger(job.id)) == 1)
    bench.store.delete(*bench.store.names(blobs.partials(job.id)))
    bench.owners.disown((owned,))
    monitor = run("monitor")
    monitor.wait_for("the blob store has no")
    monitor.process.send_signal(signal.SIGTERM)
    assert monitor.exit_code() == 0
    found = lines(monitor)
    assert about(found, "the blob store has no") == {(job.id, 0)}
    assert {one["role"] for one in found} == {"monitor"}
    (name,) = {one["monitor"] for one in found}
    assert str(monitor.process.pid) in name


@pytest.mark.parametrize("log_format", ["json", "text"])
def test_every_line_of_an_api_says_which_job_it_is_about(
    run: Run, tmp_path: Path, log_format: str
) -> None:
    redis_at = f"unix://{tmp_path}/nowhere.sock"
    api = run("api", "--port", "0", log_format=log_format, PLATEAU_REDIS_URL=redis_at)
    url = api.wait_for(r"listens at (http://127\.0\.0\.1:\d+)")
    with httpx.Client(base_url=url, trust_env=False, timeout=60) as http:  # one connection for all
        for path in ("/v1/jobs/0123456789ab", "/v1/jobs/0123456789ab/slices/7.exr", "/v1/jobs"):
            assert http.get(path).status_code == 503
    if log_format == "json":
        found = lines(api)
        assert {one["role"] for one in found} == {"api"}
        assert about(found, "GET /v1/jobs/0123456789ab:") == {("0123456789ab", None)}
        assert about(found, "/slices/7.exr:") == {("0123456789ab", 7)}
        assert about(found, "GET /v1/jobs:") == {(None, None)}
    else:  # then it has its fields at its end
        (line,) = (one for one in api.said.split("\n") if "/slices/7.exr:" in one)
        assert " role=api " in line
        assert line.endswith("job=0123456789ab slice=7")
        assert line.isprintable()


def test_an_unknown_format_is_refused(run: Run) -> None:
    worker = run("worker", log_format="yaml")
    assert worker.exit_code() == 1
    assert worker.said == "plateau: PLATEAU_LOG_FORMAT: must be text or json\n"


#: A `plateau` command in which calls of a function end in an error that nobody expects.
BROKEN = """
import importlib, sys
module, _, path = sys.argv.pop(1).partition(":")
*parents, name = path.split(".")
owner = importlib.import_module(module)
for parent in parents:
    owner = getattr(owner, parent)
def broken(*_, **__):
    raise RuntimeError("planted by a test")
setattr(owner, name, broken)
from plateau.commands import main
main()
"""


_OWN = "plateau.farm.ledger.ownership:Ownerships"


@pytest.mark.parametrize(
    ("role", "where", "words"),
    [
        ("worker", "plateau.farm.ledger.queue:SliceQueue.heartbeat", "the thread heartbeat died"),
        ("monitor", f"{_OWN}.unfinished", "an unexpected error"),
        *rare(
            ("worker", "plateau.worker.supervisor.uploader:_encoded", "the thread uploader died"),
            ("worker", "plateau.farm.ledger.queue:SliceQueue.lease", "an unexpected error"),
            ("monitor", f"{_OWN}.renew", "the thread renewer died"),
        ),
    ],
)
def test_a_process_does_not_outlive_one_of_its_threads(
    bench: Bench, cache: Path, role: str, where: str, words: str
) -> None:
    job, _ = bench.job(slices=1)
    done = subprocess.run(
        [sys.executable, "-c", BROKEN, where, role],
        env={
            "PATH": "/usr/bin:/bin",
            "PLATEAU_REDIS_URL": str(bench.settings.redis_url),
            "PLATEAU_BLOBS": bench.store.where,
            "PLATEAU_CACHE": str(cache),
            "PLATEAU_LEASE_S": "1",
            "PLATEAU_LOG_FORMAT": "json",
        },
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 70, done.stderr
    last = json.loads(done.stderr.splitlines()[-1])
    assert (last["level"], last["role"]) == ("critical", role)
    assert words in last["message"], done.stderr
    assert "RuntimeError: planted by a test" in last["exception"]
    if "uploader" in where:
        assert (last["job"], last["slice"]) == (job.id, 0)
