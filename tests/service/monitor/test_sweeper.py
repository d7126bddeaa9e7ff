"""Monitors sweep by themselves, one of them once an hour, and no trouble of it is theirs."""

import logging
import threading
from collections.abc import Iterator

import pytest
import redis

from plateau.farm.blobs.names import MARK
from plateau.farm.blobs.store import Blobs
from plateau.farm.process.settings import Settings
from plateau.farm.redis import keys
from plateau.service.monitor import sweeper
from plateau.service.monitor.sweeper import sweeping
from tests.support.farms.staged_job import StagedJob
from tests.support.until import until

ORPHAN = "jobs/0123456789ab/partials/000000-killed-1.exr"


@pytest.fixture(autouse=True)
def _soon(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(sweeper, "_POLL_S", 0.05)
    yield
    for thread in threading.enumerate():  # it sweeps to its end, which is no other test's
        if thread.name == "sweeper":
            thread.join()


@pytest.fixture
def settings(redis_url: str, store: Blobs) -> Settings:
    return Settings(redis_url=redis_url, blobs=store.where)


def finished_job(client: redis.Redis, store: Blobs) -> str:
    job = StagedJob(client)
    job.commit(4)
    job.end()
    job.picture(store, "image.png", b"a picture")
    job.finish()
    return job.id


def test_jobs_go_after_the_retention(
    settings: Settings, client: redis.Redis, store: Blobs, caplog: pytest.LogCaptureFixture
) -> None:
    job = finished_job(client, store)
    caplog.set_level(logging.INFO)
    with sweeping(settings.model_copy(update={"keep_results_days": 0.0}), store):
        until(lambda: "swept 1 old jobs" in caplog.text)
    assert store.names(f"jobs/{job}/") == []


def test_only_one_of_many_monitors_sweeps_in_an_hour(
    settings: Settings, client: redis.Redis, store: Blobs
) -> None:
    finished_job(client, store)
    with sweeping(settings, store), sweeping(settings, store):
        until(lambda: client.hexists(keys.TOTALS, "swept at"))
        store.put(ORPHAN, b"x")
        swept_at, next_at = (
            float(str(client.hget(*field)))
            for field in ((keys.TOTALS, "swept at"), (keys.STORE, "next_sweep_at"))
        )
        assert 3_500_000 < next_at - swept_at <= 3_600_000
        with pytest.raises(AssertionError):
            until(lambda: not store.exists(ORPHAN), 0.5)
        # But when the hour is over
        client.hdel(keys.STORE, "next_sweep_at")
        until(lambda: not store.exists(ORPHAN))


def test_an_error_is_said_and_the_next_sweep_comes(
    settings: Settings, client: redis.Redis, store: Blobs, caplog: pytest.LogCaptureFixture
) -> None:
    finished_job(client, store)
    store.put(ORPHAN, b"x")
    client.hset(keys.STORE, "id", "ours")
    store.put(MARK, b"another's")
    with sweeping(settings, store):
        until(lambda: "belong to another Redis" in caplog.text)
        store.put(MARK, b"ours")
        client.hdel(keys.STORE, "next_sweep_at")
        until(lambda: not store.exists(ORPHAN))
