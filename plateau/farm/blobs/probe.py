"""Checks that a blob store creates each name only once: some S3-compatible stores do not."""

import secrets
from concurrent.futures import ThreadPoolExecutor
from typing import Final

from plateau.farm.blobs.names import MARK
from plateau.farm.blobs.store import Blobs
from plateau.farm.model.errors import BlobsUnavailable, WrongStore

_RACERS: Final = 4
_ROUNDS: Final = 5


def check_create_once(store: Blobs) -> None:
    """Return if exactly one of several simultaneous creators of a name succeeds, each time.

    The mark of a store rests on it (`plateau.farm.ledger.pairing`): otherwise two farms could take
    one store for theirs, and each would sweep away the other's blobs.

    Raises
    ------
    WrongStore
        The store ignores the condition, or does not know it.
    BlobsUnavailable
        The store is away.
    """
    with ThreadPoolExecutor(_RACERS) as racers:
        for _ in range(_ROUNDS):
            name = f"{MARK}-probe-{secrets.token_hex(8)}"
            try:
                contents = [b"racer %d" % racer for racer in range(_RACERS)]
                done = list(racers.map(store.create, [name] * _RACERS, contents))
                again = store.create(name, b"a late one")
            except BlobsUnavailable as error:
                if "501" not in str(error):
                    raise
                raise WrongStore(_refusal(store, "does not know If-None-Match")) from error
            finally:
                store.delete(name)
            if done.count(True) != 1 or again:
                raise WrongStore(_refusal(store, "replaces what is there all the same"))


def _refusal(store: Blobs, how: str) -> str:
    return (
        f"{store.where} cannot be a blob store: asked to create a blob unless there is one of its "
        f"name (PutObject with If-None-Match: *) it {how}. Use one that honours this, as AWS, "
        "MinIO and versitygw do, or a folder that all machines mount"
    )
