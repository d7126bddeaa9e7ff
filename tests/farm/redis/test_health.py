"""`plateau doctor` says what a Redis lacks to carry a farm, and what to do about it."""

from collections.abc import Iterator

import pytest
import redis

from plateau.farm.redis.acl import rules
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.health import Finding, _encryption, examine

PASSWORD = "of-a-test"


@pytest.fixture(scope="module")
def embedded_redis(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmbeddedRedis]:
    """A server as a farm starts it, durable."""
    server = EmbeddedRedis(tmp_path_factory.mktemp("redis"))
    yield server
    server.process.kill()  # it was told to be a replica, and would wait for its master
    server.stop()


def findings(url: str) -> dict[str, Finding]:
    return {one.name: one for one in examine(url)}


def test_the_embedded_redis_lacks_nothing(redis_url: str, client: redis.Redis) -> None:
    found = findings(redis_url)
    assert all(one.ok for one in found.values()), found
    assert found["Redis persistence"].detail == "appendonly yes, appendfsync always"
    assert found["Redis version"].detail == client.info()["redis_version"]


@pytest.fixture
def set_to(client: redis.Redis) -> Iterator[redis.Redis]:
    before = client.config_get("append*") | client.config_get("maxmemory*")
    yield client
    for name in ("appendfsync", "appendonly", "maxmemory", "maxmemory-policy"):
        client.config_set(name, before[name])


@pytest.mark.parametrize(
    ("settings", "name", "what_to_do"),
    [
        ({"appendfsync": "everysec"}, "Redis persistence", "set `always`"),
        ({"appendonly": "no"}, "Redis persistence", "set `appendonly yes`"),
        (
            {"maxmemory": "1gb", "maxmemory-policy": "allkeys-lru"},
            "Redis memory",
            "set `noeviction`",
        ),
    ],
)
def test_what_loses_something_is_said_with_what_to_do(
    set_to: redis.Redis, redis_url: str, settings: dict[str, str], name: str, what_to_do: str
) -> None:
    for option, value in settings.items():
        set_to.config_set(option, value)
    found = findings(redis_url)
    assert what_to_do in found[name].detail
    assert [one.name for one in found.values() if not one.ok] == [name]


def test_a_replica_is_refused(client: redis.Redis, redis_url: str) -> None:
    client.replicaof("127.0.0.1", 1)
    try:
        role = findings(redis_url)["Redis role"]
    finally:
        client.replicaof("NO", "ONE")
    assert (role.ok, role.needed) == (False, True)
    assert "name its master" in role.detail


@pytest.mark.parametrize(
    ("user", "knows"), [("plateau-worker", False), ("plateau-admin", True), ("plateau-api", True)]
)
def test_each_user_learns_what_it_may(
    client: redis.Redis, embedded_redis: EmbeddedRedis, user: str, knows: bool
) -> None:
    client.execute_command(
        "ACL", "SETUSER", user, "on", f">{PASSWORD}", "resetchannels", *rules((6, 2))[user]
    )
    path = embedded_redis.url.removeprefix("unix://")
    try:
        found = findings(f"unix://{user}:{PASSWORD}@{path}")
    finally:
        client.acl_deluser(user)
    assert all(one.ok for one in found.values()), found
    assert found["Redis user"].detail == user
    assert ("Redis version" in found) is knows
    assert PASSWORD not in str(found)


def test_a_redis_that_is_away_or_refuses_is_named_without_its_password() -> None:
    (found,) = examine(f"redis://plateau-worker:{PASSWORD}@127.0.0.1:1")
    assert (found.ok, found.needed) == (False, True)
    assert "redis://plateau-worker:***@127.0.0.1:1" in found.detail
    assert PASSWORD not in found.detail


def test_in_clear_over_a_network_is_said() -> None:
    assert not _encryption("redis://farm.example").ok
    assert not _encryption("redis+sentinel://127.0.0.1,farm.example/m").ok
    assert _encryption("redis://127.0.0.1").ok
    assert _encryption("rediss+sentinel://farm.example/m").ok
