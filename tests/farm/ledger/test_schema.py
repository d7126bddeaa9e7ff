"""The layout in Redis has a version: written once, brought forward, or refused in words."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import redis

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger import schema
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.schema import await_checks, check_schema
from plateau.farm.model import versions
from plateau.farm.model.errors import SchemaMismatch, StoreUnavailable, WrongLayout
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect


def test_an_empty_redis_gets_the_version(client: redis.Redis) -> None:
    check_schema(client)
    assert client.get(keys.SCHEMA) == str(versions.LAYOUT)
    # And to look again changes nothing
    check_schema(client)
    assert client.keys("*") == [keys.SCHEMA]


def test_data_without_a_version_gets_it(client: redis.Redis) -> None:
    job = Jobs(client).create(JobSpec(), name="box", scene_sha256="00" * 32).job
    check_schema(client)
    assert client.get(keys.SCHEMA) == str(versions.LAYOUT)
    assert Jobs(client).get(job.id) == job


class TestAnOlderLayout:
    """A made-up one: its jobs had a title, which the present layout calls a name."""

    RENAMES = """
      for _, id in ipairs(redis.call('ZRANGE', JOBS, 0, -1)) do
        redis.call('HSET', job_key(id), 'name', redis.call('HGET', job_key(id), 'title'))
        redis.call('HDEL', job_key(id), 'title')
      end
    """

    @pytest.fixture
    def job_id(self, client: redis.Redis, monkeypatch: pytest.MonkeyPatch) -> str:
        monkeypatch.setattr(schema, "_MIGRATIONS", {versions.LAYOUT - 1: self.RENAMES})
        job = Jobs(client).create(JobSpec(), name="old", scene_sha256="00" * 32).job
        client.hset(keys.job(job.id), "title", job.name)
        client.hdel(keys.job(job.id), "name")
        client.set(keys.SCHEMA, versions.LAYOUT - 1)
        return job.id

    def test_is_brought_forward(self, client: redis.Redis, job_id: str) -> None:
        with pytest.raises(WrongLayout, match="start a monitor or an API of this Plateau"):
            Jobs(client).cancel(job_id)
        check_schema(client)
        assert client.get(keys.SCHEMA) == str(versions.LAYOUT)
        assert Jobs(client).get(job_id).name == "old"
        assert Jobs(client).cancel(job_id).state is JobState.CANCELLED

    def test_is_brought_forward_once(self, client: redis.Redis, job_id: str) -> None:
        check_schema(client)
        # Given what the present layout says of the job
        client.hset(keys.job(job_id), mapping={"name": "new", "title": "of no meaning"})
        # If every process of a farm starts at once
        with ThreadPoolExecutor(8) as pool:
            list(pool.map(check_schema, [connect(_url(client)) for _ in range(8)]))
        # Then that stays
        assert client.hmget(keys.job(job_id), "name", "title") == ["new", "of no meaning"]


def test_migrations_run_in_order_and_all_at_once(
    client: redis.Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Given a Plateau of layout 4, and data of layout 1
    steps = {version: f"redis.call('RPUSH', 'steps', {version})" for version in (1, 2, 3)}
    monkeypatch.setattr(versions, "LAYOUT", 4)
    monkeypatch.setattr(schema, "_MIGRATIONS", steps)
    client.set(keys.SCHEMA, 1)
    # If many of its processes start on it at once
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(check_schema, [connect(_url(client)) for _ in range(8)]))
    # Then each step was taken once
    assert client.lrange("steps", 0, -1) == ["1", "2", "3"]
    assert client.get(keys.SCHEMA) == "4"


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (
            str(versions.LAYOUT + 1),
            rf"has layout {versions.LAYOUT + 1}.*works with layout {versions.LAYOUT}.*a newer",
        ),
        ("0", "cannot migrate data that old; start a Plateau of a version between"),
        ("1.5", "no layout of Plateau's"),
        ("no number", "'no number', which is no layout of Plateau's"),
    ],
)
def test_what_cannot_be_read_is_refused_and_left_alone(
    client: redis.Redis, found: str, words: str
) -> None:
    client.set(keys.SCHEMA, found)
    with pytest.raises(SchemaMismatch, match=words):
        check_schema(client)
    assert client.get(keys.SCHEMA) == found
    assert client.keys("*") == [keys.SCHEMA]


def test_who_waits_for_redis_goes_on_when_it_comes(store: Blobs, tmp_path: Path) -> None:
    client = connect(f"unix://{tmp_path}/redis.sock")
    with pytest.raises(StoreUnavailable):
        check_schema(client)
    waiting = threading.Thread(target=await_checks, args=(client, store, threading.Event()))
    waiting.start()
    time.sleep(0.3)
    assert waiting.is_alive()
    server = EmbeddedRedis(tmp_path)
    waiting.join(60)
    assert not waiting.is_alive()
    assert client.get(keys.SCHEMA) == str(versions.LAYOUT)
    client.close()
    server.stop()


def test_who_waits_for_redis_can_be_stopped(store: Blobs, tmp_path: Path) -> None:
    stop = threading.Event()
    client = connect(f"unix://{tmp_path}/none.sock")
    waiting = threading.Thread(target=await_checks, args=(client, store, stop))
    waiting.start()
    stop.set()
    waiting.join(60)
    assert not waiting.is_alive()


def _url(client: redis.Redis) -> str:
    return f"unix://{client.connection_pool.connection_kwargs['path']}"
