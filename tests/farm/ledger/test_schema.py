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
from plateau.farm.ledger.schema import VERSION, await_checks, check_schema
from plateau.farm.model.errors import SchemaMismatch, StoreUnavailable
from plateau.farm.model.spec import JobSpec
from plateau.farm.redis import keys
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect


def test_an_empty_redis_gets_the_version(client: redis.Redis) -> None:
    check_schema(client)
    assert client.get(keys.SCHEMA) == str(VERSION)
    # And to look again changes nothing
    check_schema(client)
    assert client.keys("*") == [keys.SCHEMA]


class TestLayout1:
    """It is that of a Plateau which wrote no version down."""

    @pytest.fixture
    def job_id(self, client: redis.Redis) -> str:
        job = Jobs(client).create(JobSpec(), name="old", scene_sha256="00" * 32).job
        client.hset(keys.job(job.id), "checkpoint", f"jobs/{job.id}/checkpoints/0000100-1.npz")
        return job.id

    def test_is_brought_forward(self, client: redis.Redis, job_id: str) -> None:
        check_schema(client)
        assert client.get(keys.SCHEMA) == str(VERSION)
        # Its results are found where they were put then, and its checkpoint is not taken for one
        assert Jobs(client).results(job_id) == f"jobs/{job_id}"
        assert not client.hexists(keys.job(job_id), "checkpoint")
        assert Jobs(client).get(job_id).name == "old"
        # Of how many samples they are is known of jobs that had any
        assert Jobs(client).get(job_id).image_spp is None
        client.hset(keys.job(job_id), "spp", 100)
        assert Jobs(client).get(job_id).image_spp == 100

    def test_is_brought_forward_once(self, client: redis.Redis, job_id: str) -> None:
        check_schema(client)
        # Given what the present layout says of the job
        client.hset(keys.job(job_id), mapping={"checkpoint": "{}", "results": "jobs/new"})
        # If every process of a farm starts at once
        with ThreadPoolExecutor(8) as pool:
            list(pool.map(check_schema, [connect(_url(client)) for _ in range(8)]))
        # Then that stays
        assert client.hmget(keys.job(job_id), "checkpoint", "results") == ["{}", "jobs/new"]

    def test_is_seen_by_its_scenes_too(self, client: redis.Redis) -> None:
        client.hset(keys.SCENES, "00" * 32, "{}")
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(schema, "_MIGRATIONS", {})
            with pytest.raises(SchemaMismatch, match="has layout 1"):
                check_schema(client)


def test_the_owner_of_a_job_goes_where_no_worker_writes(client: redis.Redis) -> None:
    # Given a job of layout 5, with its owner in its hash, and one of nobody's
    mine, nobodys = (
        Jobs(client).create(JobSpec(), name="old", scene_sha256="00", owner=owner).job.id
        for owner in ("a" * 12, "")
    )
    client.delete(keys.job(mine, "sealed"))
    client.hdel(keys.job(mine), "party")
    client.hset(keys.job(mine), mapping={"owner": "a" * 12, "owner_name": "anna"})
    client.hset(keys.job(nobodys), "owner", "")
    client.set(keys.SCHEMA, 5)
    check_schema(client)
    # Then it is the owner's still, and counts in his share
    found = [Jobs(client).get(job_id) for job_id in (mine, nobodys)]
    assert [(job.owner, job.owner_name) for job in found] == [("a" * 12, "anna"), (None, None)]
    assert client.hmget(keys.job(mine), "owner", "owner_name", "party") == [None, None, "a" * 12]
    assert client.exists(keys.job(nobodys, "sealed")) == 0


def test_migrations_run_in_order_and_all_at_once(
    client: redis.Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Given a Plateau of layout 4, and data of layout 1
    steps = {version: f"redis.call('RPUSH', 'steps', {version})" for version in (1, 2, 3)}
    monkeypatch.setattr(schema, "VERSION", 4)
    monkeypatch.setattr(schema, "_MIGRATIONS", steps)
    client.zadd(keys.JOBS, {"0123456789ab": 1})
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
            str(VERSION + 1),
            rf"has layout {VERSION + 1}.*works with layout {VERSION}.*newer Plateau",
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
    assert client.get(keys.SCHEMA) == str(VERSION)
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
