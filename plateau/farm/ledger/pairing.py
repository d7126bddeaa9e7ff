"""Pairs a blob store with its Redis by an id that both have.

A worker on another store would fail every job. An empty folder in place of a mounted disk holds no
blob. For a Redis that lost its data, all results would belong to no job.
"""

import secrets

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.model.errors import NotPermitted, StoreUnavailable, WrongStore
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.members import Pair
from plateau.farm.redis.scripts import Scripts


def check_pair(client: RedisClient, store: Blobs) -> None:
    """Return if Redis and the blob store belong together; the first time, pair them.

    From then on `store` can tell its folder from an empty one.

    Raises
    ------
    WrongStore
        They do not belong together; nothing was changed.
    StoreUnavailable
        One of the two is away.
    """
    try:
        _check_pair(client, store)
    except NotPermitted:
        raise StoreUnavailable(
            "Redis and the blob store are not paired yet, and this process may not pair them; "
            "start a monitor or an API, which does"
        ) from None


def _check_pair(client: RedisClient, store: Blobs) -> None:
    # In this order: a process that pairs them writes the id before the mark.
    theirs = store.mark()
    ours, paired = client.hmget(keys.STORE, "id", "paired")
    if theirs is None and paired is not None:  # paired between the two reads
        theirs = store.mark()
    if theirs is None and paired is None:
        if not client.exists(keys.JOBS) and any(store.listing(blobs.JOBS)):
            raise WrongStore(_refusal(store, None, None))
        made = Scripts(client).run(Pair(id=secrets.token_hex(8), is_marked=False))
        ours, theirs = made, store.make_mark(made)
    if theirs is None or theirs != ours:
        raise WrongStore(_refusal(store, ours, theirs))
    if paired is None:
        Scripts(client).run(Pair(id=ours, is_marked=True))


def _refusal(store: Blobs, ours: str | None, theirs: str | None) -> str:
    if theirs is None and ours is not None:
        return (
            f"{store.where} is not the blob store of this Redis: set PLATEAU_BLOBS to the one that "
            "its other processes use, or mount what should be there"
        )
    return (
        f"the blobs in {store.where} belong to another Redis than this one, or this one has lost "
        f"its data: the blob {blobs.MARK} says {theirs or 'nothing'}, and the key {keys.STORE} "
        f"says {ours or 'nothing'}. Set PLATEAU_BLOBS and PLATEAU_REDIS_URL to two that belong "
        "together. Nothing was changed"
    )
