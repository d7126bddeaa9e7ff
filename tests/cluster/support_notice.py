"""A user of Redis that works on until it notices that it cannot.

``python -m tests.cluster.support_notice WHAT URL``, where WHAT is ``request``, ``renewal``,
``listener`` or ``events``. It says "ready" when it has begun; then when it noticed, and an error's
words.
"""

import asyncio
import sys
import time

from redis.exceptions import RedisError

from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.process.waits import Stop
from plateau.farm.redis.link import connect, connect_to_renew, now_ms, unavailable_as_farm_error
from plateau.farm.redis.wake import Wake
from plateau.service.api.events.hub import EventHub

#: That of `plateau.farm.process.settings`.
LEASE_S = 15.0


def ask(url: str, *, renews: bool) -> None:
    """Ask again and again, as for work, or as who renews leases does."""
    client = connect_to_renew(url, LEASE_S) if renews else connect(url)
    client.ping()
    print("ready", flush=True)
    while True:
        with unavailable_as_farm_error():
            now_ms(client)
        time.sleep(0.1)


def listen(url: str) -> None:
    """Wait for hints, of which none comes."""
    wake, never = Wake(connect(url), "a channel"), Stop()
    wake.wait(0.5, never)
    print("ready", flush=True)
    while True:
        wake.wait(0.5, never)


async def read_events(url: str) -> None:
    """Wait for the events of a job, as the API does, of which none comes."""
    client = EventHub(url)._redis
    await client.ping()
    print("ready", flush=True)
    while True:
        await client.xread({"a stream": "0-0"}, block=5000)


if __name__ == "__main__":
    what, where = sys.argv[1:]
    try:
        if what == "events":
            asyncio.run(read_events(where))
        elif what == "listener":
            listen(where)
        else:
            ask(where, renews=what == "renewal")
    except (StoreUnavailable, RedisError, OSError) as error:
        print(time.time(), error)
