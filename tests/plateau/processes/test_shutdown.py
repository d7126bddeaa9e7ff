"""A process that is asked to stop: once is enough, twice ends it, and it has a time limit."""

import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from plateau.errors import ExitCode

#: A process that takes its time, whatever it is asked.
STUBBORN = """
import sys, time
from plateau.processes import process as stopping
stopping.LIMIT_S = float(sys.argv[1])
stop = stopping.StopSignals().asked
print("ready", flush=True)
stop.wait()
print("asked", flush=True)
time.sleep(600)
"""


@pytest.fixture
def stubborn(request: pytest.FixtureRequest) -> Iterator["subprocess.Popen[str]"]:
    process = subprocess.Popen(
        [sys.executable, "-c", STUBBORN, str(request.param)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


@pytest.mark.parametrize("stubborn", [600], indirect=True)
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_second_signal_ends_it(stubborn: "subprocess.Popen[str]", number: signal.Signals) -> None:
    # Given one that was asked, by two signals that came together
    stubborn.send_signal(signal.SIGTERM)
    stubborn.send_signal(signal.SIGTERM)
    assert stubborn.stdout is not None
    assert stubborn.stdout.readline() == "asked\n"
    time.sleep(1.5)
    assert stubborn.poll() is None
    # If another comes, it is ended by that
    stubborn.send_signal(number)
    assert stubborn.wait(30) == -number


@pytest.mark.parametrize("stubborn", [0.5], indirect=True)
def test_one_that_does_not_stop_is_ended_by_the_limit(stubborn: "subprocess.Popen[str]") -> None:
    stubborn.send_signal(signal.SIGTERM)
    assert stubborn.wait(30) == ExitCode.FAILED
