"""Whether a blob store creates a blob of a name but once: some S3-compatible stores do not."""

import secrets
from concurrent.futures import ThreadPoolExecutor
from typing import Final

from plateau.farm.blobs.store import MARK, Blobs
from plateau.farm.model.errors import BlobsUnavailable, WrongStore

_RACERS: Final = 4
_ROUNDS: Final = 5


def check_create_once(store: Blobs) -> None:
    """Return where of several who create a blob of one name at once exactly one does, each time.

    The mark of a store rests on it, see `plateau.farm.ledger.pairing`: two farms that came for the
    store at the same moment would both take it for theirs, and each would sweep away what is the
    other's.

    Raises
    ------
    WrongStore
        The store ignores the condition, or does not know it.
    BlobsUnavailable
        It is away.
    """
    with ThreadPoolExecutor(_RACERS) as racers:
        for _ in range(_ROUNDS):
            name = f"{MARK}-probe-{secrets.token_hex(8)}"
            try:
                done = list(
                    racers.map(store.create, [name] * _RACERS, map(_content, range(_RACERS)))
                )
                again = store.create(name, _content(_RACERS))
            except BlobsUnavailable as error:
                if "501" not in str(error):
                    raise
                raise WrongStore(_refusal(store, "does not know If-None-Match")) from error
            finally:
                store.delete(name)
            if done.count(True) != 1 or again:
                raise WrongStore(_refusal(store, "replaces what is there all the same"))


def _content(racer: int) -> bytes:
    return b"racer %d" % racer


def _refusal(store: Blobs, how: str) -> str:
    return (
        f"{store.where} cannot be a blob store: asked to create a blob unless there is one of its "
        f"name (PutObject with If-None-Match: *) it {how}. Use one that honours this, as AWS, "
        "MinIO and versitygw do, or a folder that all machines mount"
    )
