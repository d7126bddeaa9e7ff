"""A Redis and a blob store that do not belong together are told apart before harm is done."""

from pathlib import Path

import pytest
import redis

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.pairing import check_pair
from plateau.farm.model.errors import WrongStore
from plateau.farm.redis import keys


def test_the_first_time_pairs_them_for_good(client: redis.Redis, store: Blobs) -> None:
    for _ in range(2):
        check_pair(client, store)
    assert store.mark() == client.hget(keys.STORE, "id")
    assert store.names("") == []  # the mark is nobody's blob


def test_a_process_that_died_while_it_paired_them_does_no_harm(
    client: redis.Redis, store: Blobs
) -> None:
    client.hset(keys.STORE, "id", "ours")
    check_pair(client, store)
    assert store.mark() == "ours"


def test_another_store_is_refused(client: redis.Redis, store: Blobs, tmp_path: Path) -> None:
    check_pair(client, store)
    empty = Blobs(str(tmp_path / "empty"))
    with pytest.raises(WrongStore, match="is not the blob store of this Redis"):
        check_pair(client, empty)
    assert empty.mark() is None


def test_a_redis_that_lost_its_data_is_refused(client: redis.Redis, store: Blobs) -> None:
    # Also where the blobs were never marked
    store.put("jobs/0123456789ab/results/1/image.png", b"x")
    with pytest.raises(WrongStore, match="has lost its data"):
        check_pair(client, store)
    store.delete("jobs/0123456789ab/results/1/image.png")
    check_pair(client, store)
    client.flushall()
    with pytest.raises(WrongStore, match="has lost its data"):
        check_pair(client, store)
