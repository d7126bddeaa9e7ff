"""The order to stop: an event, and something to poll."""

import gc
import os
import select
import signal
import threading
from contextlib import suppress

from plateau.farm.process.waits import Backoff, Stop


def _is_readable(stop: Stop, timeout_ms: int) -> bool:
    poll = select.poll()
    poll.register(stop, select.POLLIN)
    return bool(poll.poll(timeout_ms))


def test_it_is_readable_once_it_is_set() -> None:
    stop = Stop()
    assert not stop.is_set()
    assert not _is_readable(stop, 0)
    threading.Timer(0.1, stop.set).start()
    assert _is_readable(stop, 30_000)
    assert stop.wait(30)
    # And stays so for all who poll it, however often it is set
    for _ in range(100_000):  # more than a pipe holds
        stop.set()
    assert all(_is_readable(stop, 0) for _ in range(3))


def test_a_signal_handler_sets_it_in_whatever_its_own_thread_is() -> None:
    for _ in range(100):
        stop = Stop()
        signal.signal(signal.SIGPROF, lambda *_, stop=stop: stop.set())
        signal.setitimer(signal.ITIMER_PROF, 1e-5)
        while not stop.wait(0):
            pass


def test_nothing_of_it_is_left_open() -> None:
    stop = Stop()
    descriptor = stop.fileno()
    pipe = os.fstat(descriptor).st_ino
    del stop
    gc.collect()
    with suppress(OSError):  # unless it is another's by now
        assert os.fstat(descriptor).st_ino != pipe


def test_waits_double_up_to_the_longest_each_spread_by_half() -> None:
    backoff = Backoff(1.0, 4.0)
    for unspread in (1.0, 2.0, 4.0, 4.0):
        assert unspread / 2 <= backoff.delay_s() <= 1.5 * unspread
    backoff.reset()
    assert backoff.delay_s() <= 1.5


def test_many_that_begin_together_do_not_come_back_together() -> None:
    # Uniform over [0.5, 1.5]: that a hundred lie within a quarter has a chance below 1e-56
    waits = [Backoff(1.0, 4.0).delay_s() for _ in range(100)]
    assert max(waits) - min(waits) > 0.25
