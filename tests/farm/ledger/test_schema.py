"""The layout in Redis has a version: written once, and compared by every process and command."""

from concurrent.futures import ThreadPoolExecutor

import pytest
import redis

from plateau.farm.ledger.schema import check_schema
from plateau.farm.model import versions
from plateau.farm.model.errors import Incompatible
from plateau.farm.redis import keys
from plateau.farm.redis.link import connect
from plateau.farm.redis.scripts import Scripts
from tests.support.redis.redis_commands import commands, named


def test_an_empty_redis_gets_the_version(client: redis.Redis) -> None:
    # If every process of a farm starts at once
    path = client.connection_pool.connection_kwargs["path"]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(check_schema, [connect(f"unix://{path}", 120.0) for _ in range(8)]))
    assert client.get(keys.SCHEMA) == str(versions.LAYOUT)
    # And to look again changes nothing
    check_schema(client)
    assert client.keys("*") == [keys.SCHEMA]


REFUSAL = (
    r"has layout {}, and this Plateau, .*, works with layout "
    rf"{versions.LAYOUT}: install the Plateau that wrote it, or choose another"
)


@pytest.mark.parametrize(
    ("found", "words"),
    [
        ("0", REFUSAL.format(0)),
        (str(versions.LAYOUT - 1), REFUSAL.format(versions.LAYOUT - 1)),
        (str(versions.LAYOUT + 1), REFUSAL.format(versions.LAYOUT + 1)),
        ("1.5", "of layout '1.5', which is none of Plateau's"),
        ("no number", "of layout 'no number', which is none of Plateau's"),
    ],
)
def test_another_version_is_refused_and_left_alone(
    client: redis.Redis, found: str, words: str
) -> None:
    client.set(keys.SCHEMA, found)
    with pytest.raises(Incompatible, match=words):
        check_schema(client)
    assert client.get(keys.SCHEMA) == found
    assert client.keys("*") == [keys.SCHEMA]


def test_every_command_looks_first(client: redis.Redis) -> None:
    client.set(keys.SCHEMA, "0")
    runner = Scripts(client)
    for name in commands():
        with pytest.raises(Incompatible, match="has layout 0"):
            runner.run(named(name))
    assert client.keys("*") == [keys.SCHEMA]
