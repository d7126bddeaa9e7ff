"""What runs on a node: ``python -m plateau.engines.node``, a worker that ends with its run.

Where PLATEAU_FRONT tells of a run's front, the node first looks for an address at which that
answers, and says by its exit code what is wrong. Then it is a worker like any other, which ends
when the front has been silent for a while: killed, cut off, or on a machine that is no more.
Without that variable it is ``plateau worker``.
"""

import logging
import os
import signal
import socket
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Final, NoReturn

from plateau.engines.front import CANNOT_REACH, NOT_LET_IN, Front
from plateau.errors import CommandFailed, ExitCode, tell
from plateau.farm.blobs.store import Blobs
from plateau.farm.model import versions
from plateau.farm.model.errors import StoreUnavailable, WrongPassword
from plateau.farm.redis.link import connect
from plateau.processes.process import run_until_signal, when_checked
from plateau.worker.supervisor.supervisor import run

_LOG = logging.getLogger("plateau")

_ANSWER_S: Final = 3.0  #: for one try at one address
_SEEK_S: Final = 12.0  #: for all tries, when the node starts
_AGAIN_S: Final = 1.0
_ASK_S: Final = 5.0  #: between two looks whether the front is there
#: A front that has not answered for so long is gone; shorter silences cost nothing.
SILENCE_S: Final = 30.0
#: How long a worker whose front is gone may take to end, before it is ended.
_END_S: Final = 10.0


def main() -> None:
    """Work for the run until it is over, or until a signal."""
    front = Front.told()
    try:
        if front is not None:
            _join(front)
        run_until_signal("worker", when_checked(run))
    except CommandFailed as error:
        _refuse(ExitCode.FAILED, str(error))


def _join(front: Front) -> None:
    """Check that this node can work for the run, point its worker there, and watch the front."""
    if front.version != versions.plateau():
        _refuse(
            ExitCode.INCOMPATIBLE,
            f"the run is Plateau {front.version}'s, and {sys.executable} here has "
            f"{versions.plateau()}",
        )
    host = _reached(front)
    os.environ["PLATEAU_REDIS_URL"] = front.redis_url(host)
    os.environ["PLATEAU_BLOBS"] = front.blobs(host)
    threading.Thread(target=_watch, args=(front.redis_url(host),), daemon=True).start()


def _reached(front: Front) -> str:
    """The first of the front's hosts that answers."""
    deadline = time.monotonic() + _SEEK_S
    while True:
        pool = ThreadPoolExecutor(len(front.hosts))
        tries = {pool.submit(_try, front, host): host for host in front.hosts}
        pool.shutdown(wait=False)  # the first answer is enough
        failures = []
        for one in as_completed(tries):
            error = one.exception()
            if error is None:
                return tries[one]
            failures.append((tries[one], error))
        if any(isinstance(error, WrongPassword) for _, error in failures):
            _refuse(NOT_LET_IN, f"what answers is not the Redis of this run: {_told(failures)}")
        if time.monotonic() > deadline:
            _refuse(CANNOT_REACH, f"the machine of the run cannot be reached: {_told(failures)}")
        time.sleep(_AGAIN_S)


def _try(front: Front, host: str) -> None:
    """Return if Redis and the blobs answer at this host; raise `StoreUnavailable` otherwise."""
    with connect(front.redis_url(host), _ANSWER_S) as client:
        client.ping()
    Blobs(front.blobs(host)).mark()


def _told(failures: list[tuple[str, BaseException]]) -> str:
    return "; ".join(f"tried {host} ({error})" for host, error in failures)


def _watch(url: str) -> None:
    """End this process once the front has been silent for long; runs in a thread."""
    with connect(url, _ANSWER_S) as client:
        heard_at = time.monotonic()
        while time.monotonic() < heard_at + SILENCE_S:
            time.sleep(_ASK_S)
            try:
                client.ping()
                heard_at = time.monotonic()
            except StoreUnavailable:
                continue
    _LOG.critical("the machine of the run has been silent for %g s: the run is over", SILENCE_S)
    os.kill(os.getpid(), signal.SIGTERM)  # the worker ends its render child
    time.sleep(_END_S)
    os._exit(CANNOT_REACH)


def _refuse(code: int, why: str) -> NoReturn:
    tell(f"{socket.gethostname()}: {why}")
    sys.exit(code)


if __name__ == "__main__":
    main()
