"""Waking each other up: a hint ends a wait, and so does the order to stop."""

import threading
import time

import redis

from farm.wake import Wake

CHANNEL = "a channel of the test"


def test_a_message_ends_the_wait(client: redis.Redis) -> None:
    wake, never = Wake(client, CHANNEL), threading.Event()
    assert wake.wait(0.0, never) == set()
    client.publish(CHANNEL, "one")
    client.publish(CHANNEL, "two")
    started = time.monotonic()
    heard = wake.wait(30.0, never)
    heard |= wake.wait(0.0, never)
    assert heard == {"one", "two"}
    assert time.monotonic() - started < 10
    wake.close()


def test_so_does_the_order_to_stop(client: redis.Redis) -> None:
    wake, stop = Wake(client, CHANNEL), threading.Event()
    threading.Timer(0.3, stop.set).start()
    started = time.monotonic()
    assert wake.wait(30.0, stop) == set()
    assert 0.2 < time.monotonic() - started < 10
    # Who asks after that gets what there is, at once
    client.publish(CHANNEL, "late")
    assert wake.wait(30.0, stop) <= {"late"}
    assert time.monotonic() - started < 10
    wake.close()
