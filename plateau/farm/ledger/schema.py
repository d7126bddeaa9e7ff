"""The checks of every process at its start: Redis's layout, and its pairing with the blobs."""

import logging
import random
import threading
from typing import Final

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.pairing import check_pair
from plateau.farm.model import versions
from plateau.farm.model.errors import Incompatible, NotPermitted, StoreUnavailable
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient

_LOG = logging.getLogger(__name__)

_RETRY_S: Final = 1.0

#: Give an empty Redis the layout; return the one that it has now.
_SET_UP: Final = """
redis.call('SET', KEYS[1], ARGV[1], 'NX')
return redis.call('GET', KEYS[1])
"""


def check_schema(client: RedisClient) -> None:
    """Return if the data in Redis has this Plateau's layout; an empty Redis is given it.

    Raises
    ------
    Incompatible
        The layout is another; nothing was changed.
    StoreUnavailable
        Redis is away, or empty and this process may not set it up.
    """
    found = client.get(keys.SCHEMA)
    if found is None:
        try:
            found = client.eval(_SET_UP, 1, keys.SCHEMA, versions.LAYOUT)
        except NotPermitted:
            raise StoreUnavailable(
                "Redis has no data of Plateau's yet, and this process may not set it up; start "
                "a monitor or an API, which does"
            ) from None
    if found != str(versions.LAYOUT):
        raise Incompatible(found)


def await_checks(client: RedisClient, store: Blobs, stop: threading.Event) -> None:
    """As `check_schema` and `check_pair`, but wait for both stores; unchecked at `stop`."""
    while not stop.is_set():
        try:
            check_schema(client)
            check_pair(client, store)
        except StoreUnavailable as error:
            _LOG.warning("%s; trying again", error)
            stop.wait(_RETRY_S * random.uniform(0.5, 1.5))
        else:
            return
