"""Python writes nothing to Redis by itself: every write is a script, and looks at the layout."""

import pytest
import redis

from plateau.farm.ledger.totals import note_sweep, take_census
from tests.support.redis import redis_writes
from tests.support.redis.redis_writes import READS, ROOT


def test_what_all_modules_may_send_writes_nothing(client: redis.Redis) -> None:
    known = client.command()
    assert {name for name in READS if "write" in known[name.lower()]["flags"]} == set()


def test_a_write_is_found_when_it_is_sent(client: redis.Redis) -> None:
    # Given code of Plateau's that writes by itself
    note = compile("client.hset('a', 'b', 1)", str(ROOT / "plateau" / "notes.py"), "exec")
    with pytest.raises(AssertionError, match=r"plateau/notes.py:1 sends HSET to Redis by itself"):
        exec(note, {"client": client})
    assert redis_writes.found.pop().startswith("plateau/notes.py:1")
    # But not what a script writes, or a test
    note_sweep(client)
    client.hset("a", "b", 1)
    assert take_census(client).swept_at is not None
