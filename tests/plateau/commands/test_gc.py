"""`plateau gc` on every place where it may find its data."""

import json
import signal
from pathlib import Path

import pytest
import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.schema import check_schema
from plateau.farm.redis import keys
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from plateau.farm.sweep import is_due
from tests.support.farms.staged_job import StagedJob
from tests.support.processes.commands import Command, plateau

READY = r"listens at (http://127\.0\.0\.1:\d+)"


def fill(client: redis.Redis, store: Blobs) -> StagedJob:
    """A finished job with three pictures, a queued one, and an orphan."""
    check_schema(client)  # as whoever came first did
    job = StagedJob(client)
    job.commit(4)
    job.end()
    for name in ("image.exr", "image.png", "difference.png"):
        job.picture(store, name, bytes(1000))
    job.finish()
    queued = StagedJob(client)
    store.put(blobs.partial(queued.id, 0, "w-1"), b"needed")
    store.put(blobs.partial(job.id, 9, "killed-1"), bytes(500))
    return job


def gc(folder: Path, *arguments: str, code: int = 0, **environment: str) -> str:
    """Run ``plateau gc`` in this process; returns what it says."""
    environment = {"PLATEAU_DATA": str(folder / "data"), **environment}
    found, out, err = plateau("gc", *arguments, **environment)
    assert found == code, out + err
    return out + err


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A data folder as `plateau up` leaves it, with jobs in it."""
    folder = tmp_path / "data"
    server = EmbeddedRedis(folder / "redis")
    with connect(server.url, 120.0) as client:
        fill(client, Blobs(str(folder / "blobs")))
        assert is_due(client, 3600)  # no monitor sweeps within this hour
    server.stop()
    return folder


def kept(data: Path) -> tuple[int, int]:
    """How many jobs the folder has, and how many blobs of jobs."""
    server = EmbeddedRedis(data / "redis")
    try:
        with connect(server.url, 120.0) as client:
            return client.zcard(keys.JOBS), len(Blobs(str(data / "blobs")).names(blobs.JOBS))
    finally:
        server.stop()


@pytest.mark.usefixtures("data")
def test_without_a_limit_orphans_go_and_it_says_how_to_set_one(tmp_path: Path, data: Path) -> None:
    said = gc(tmp_path)
    assert said.splitlines() == [
        f"Removed 1 blob, 500 bytes, from {data / 'blobs'}:",
        "  jobs           –  kept for ever: --results-older-than DAYS sets a limit",
        "  deleted        0  jobs, deleted more than 7 days ago",
        "  sums           0  of jobs finished more than 3 days ago",
        "  scenes         –  kept for ever: --scenes-unused-for DAYS sets a limit",
        "  orphans        1  blobs that no job needs",
    ]
    assert kept(data) == (2, 4)


def test_a_dry_run_is_true_and_removes_nothing(tmp_path: Path, data: Path) -> None:
    would = gc(tmp_path, "--results-older-than", "0", "--dry-run")
    assert would.startswith("Would remove 4 blobs, 3.5 kB, from ")
    assert "jobs           1  finished more than 0 days ago" in would
    assert kept(data) == (2, 5)
    did = json.loads(gc(tmp_path, "--results-older-than", "0", "--json"))
    expected = {"jobs": 1, "deleted": 0, "sums": 0, "scenes": 0, "orphans": 0}
    assert did == {"dry_run": False, **expected, "blobs": 4, "freed_bytes": 3500}
    # What is not finished is as it was
    assert kept(data) == (1, 1)


def test_the_settings_set_the_limits_too(tmp_path: Path, data: Path) -> None:
    said = gc(tmp_path, PLATEAU_KEEP_RESULTS_DAYS="0")
    assert "jobs           1  finished more than 0 days ago" in said
    assert "scenes         0  of no job, last used more than 0 days ago" in said
    assert kept(data) == (1, 1)


def test_it_works_beside_a_service(tmp_path: Path, data: Path) -> None:
    with Command("up", "--workers", "0", "--port", "0", folder=tmp_path) as up:
        up.wait_for(READY)
        # As a real command, once
        real = Command("gc", "--results-older-than", "0", folder=tmp_path)
        assert real.exit_code() == 0, real.said
        assert "Removed 4 blobs" in real.said
        with connect(up.wait_for(r"PLATEAU_REDIS_URL=(\S+)"), 120.0) as client:
            jobs = Jobs(client).search()[0]
            assert len(jobs) == 1
        up.process.send_signal(signal.SIGTERM)
        assert up.exit_code() == 0, up.said


def test_it_works_on_a_farm_of_many_machines(
    tmp_path: Path, client: redis.Redis, redis_url: str, store: Blobs
) -> None:
    fill(client, store)
    farm = {"PLATEAU_REDIS_URL": redis_url, "PLATEAU_BLOBS": store.where}
    assert "Removed 4 blobs" in gc(tmp_path, "--results-older-than", "0", **farm)
    assert client.zcard(keys.JOBS) == 1


class TestWhatItRefuses:
    def test_a_folder_with_nothing_in_it(self, tmp_path: Path) -> None:
        said = gc(tmp_path, code=1)
        assert said.startswith("plateau: there is no data of Plateau in ")
        assert not (tmp_path / "data").exists()

    def test_a_redis_without_its_blobs(self, tmp_path: Path, data: Path, redis_url: str) -> None:
        said = gc(tmp_path, code=1, PLATEAU_REDIS_URL=redis_url)
        assert said.startswith("plateau: set PLATEAU_BLOBS too")
        assert kept(data) == (2, 5)

    def test_the_blobs_of_another_redis(self, tmp_path: Path, data: Path, redis_url: str) -> None:
        gc(tmp_path)
        farm = {"PLATEAU_REDIS_URL": redis_url, "PLATEAU_BLOBS": str(data / "blobs")}
        said = gc(tmp_path, "--results-older-than", "0", code=1, **farm)
        assert "belong to another Redis" in said
        assert len(said.splitlines()) == 1
        assert kept(data) == (2, 4)
