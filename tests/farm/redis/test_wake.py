"""Waking each other up: a hint ends a wait, and so does the order to stop."""

import threading
import time
from pathlib import Path

import pytest
import redis

from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.process.waits import Stop
from plateau.farm.redis.link import connect
from plateau.farm.redis.wake import Wake
from tests.support.faults.redis_proxy import RedisProxy
from tests.support.until import until

CHANNEL = "a channel of the test"


def test_a_message_ends_the_wait(client: redis.Redis) -> None:
    wake, never = Wake(client, CHANNEL), Stop()
    assert wake.wait(0.0, never) == set()
    client.publish(CHANNEL, "one")
    client.publish(CHANNEL, "two")
    started = time.monotonic()
    heard: set[str] = set()
    while "two" not in heard:  # Redis may send them apart
        heard |= wake.wait(600.0, never)
    assert heard == {"one", "two"}
    assert time.monotonic() - started < 300
    wake.close()


def test_so_does_the_order_to_stop(client: redis.Redis) -> None:
    wake, stop = Wake(client, CHANNEL), Stop()
    started = time.monotonic()
    threading.Timer(0.3, stop.set).start()
    assert wake.wait(600.0, stop) == set()
    assert 0.2 < time.monotonic() - started < 300
    # Who asks after that gets what there is, at once
    client.publish(CHANNEL, "late")
    assert wake.wait(600.0, stop) <= {"late"}
    assert time.monotonic() - started < 300
    wake.close()


def test_a_connection_that_died_in_silence_is_given_up_and_made_anew(
    client: redis.Redis, redis_url: str
) -> None:
    never = Stop()
    with RedisProxy(Path(redis_url.removeprefix("unix://"))) as proxy:
        wake = Wake(connect(proxy.url), CHANNEL, quiet_s=0.3, answer_s=60.0)
        assert wake.wait(1.0, never) == set()  # it is asked and answers
        proxy.fail("silent")
        wake._answer_s = 1.0
        with pytest.raises(StoreUnavailable, match="says nothing any more"):
            wake.wait(30.0, never)
        until(lambda: client.pubsub_numsub(CHANNEL) == [(CHANNEL, 0)])
        # The network lets new connections through again; the old one it has forgotten
        proxy.mood, wake._answer_s = "through", 60.0
        assert wake.wait(1.0, never) == set()
        until(lambda: client.pubsub_numsub(CHANNEL) == [(CHANNEL, 1)])
        client.publish(CHANNEL, "heard again")
        assert wake.wait(30.0, never) == {"heard again"}
        wake.close()


def test_who_did_not_listen_for_long_is_not_taken_for_deaf(client: redis.Redis) -> None:
    wake, never = Wake(client, CHANNEL, quiet_s=0.1, answer_s=60.0), Stop()
    assert wake.wait(0.2, never) == set()  # it has asked
    wake._answer_s = 0.4
    time.sleep(0.5)  # when something else was to be done
    client.publish(CHANNEL, "meanwhile")
    assert wake.wait(30.0, never) == {"meanwhile"}
    wake.close()
