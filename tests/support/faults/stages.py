"""Runs a ``plateau`` command that a signal hits at an exact stage of its work.

``python -m tests.support.faults.stages WORKER_OR_MONITOR …`` with the stage in ``STAGE``: a JSON
object of

- ``where``: ``module:function`` or ``module:Class.method``, and ``when``, ``before`` or ``after``
  it runs;
- ``time``: at its how manieth call;
- ``signal``: its name; ``target``: ``self``, or ``children`` for every child process. Children that
  are hit after a call stand still during it: they cannot be done with what it asks of them;
- ``write``: a file into which the process writes at that stage, in the place of the signal: where
  the file's disk is frozen, its thread waits as on a disk that does not answer;
- ``set``: constants to change first, as ``{"module:NAME": value}``; there may be nothing else;
- ``clock_s``: by how many seconds its wall clock is ahead.

The code under test knows nothing of it: the functions are wrapped from outside, the processes and
the signals are real. In a forked process, a constant that another module imports by name has to be
set there, too.
"""

import contextlib
import functools
import importlib
import itertools
import json
import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil

from plateau.commands import main


def resolve(where: str) -> tuple[Any, str]:
    """The object that holds the named attribute, and the attribute's name."""
    module, _, path = where.partition(":")
    owner: Any = importlib.import_module(module)
    *parents, name = path.split(".")
    for parent in parents:
        owner = getattr(owner, parent)
    return owner, name


def hit(stage: dict[str, Any]) -> None:
    if "write" in stage:
        Path(stage["write"]).write_text("it answers again")
        return
    number = signal.Signals[stage["signal"]]
    if stage["target"] == "self":
        os.kill(os.getpid(), number)
        # A stop takes hold, or a handler runs, a moment after the call: not past this stage.
        time.sleep(0.2)
    else:
        tell_children(number)


def tell_children(number: signal.Signals) -> None:
    for child in psutil.Process().children():
        with contextlib.suppress(psutil.NoSuchProcess):  # it has ended meanwhile
            child.send_signal(number)


def set_clock_ahead(seconds: float) -> None:
    """Change what Python's `time` says of the wall clock."""
    now, now_ns = time.time, time.time_ns
    time.time = lambda: now() + seconds
    time.time_ns = lambda: now_ns() + int(seconds * 1e9)


def arm(stage: dict[str, Any]) -> None:
    for where, value in stage.get("set", {}).items():
        setattr(*resolve(where), value)
    if "clock_s" in stage:
        set_clock_ahead(stage["clock_s"])
    if "where" not in stage:
        return
    owner, name = resolve(stage["where"])
    original: Callable[..., Any] = getattr(owner, name)
    calls = itertools.count(1)

    @functools.wraps(original)
    def wrapped(*arguments: Any, **named: Any) -> Any:
        if next(calls) != stage["time"]:
            return original(*arguments, **named)
        if stage["when"] == "before":
            hit(stage)
            return original(*arguments, **named)
        still = stage.get("target") == "children"
        if still:
            tell_children(signal.SIGSTOP)
        answer = original(*arguments, **named)
        hit(stage)
        if still and stage["signal"] != "SIGSTOP":
            tell_children(signal.SIGCONT)
        return answer

    setattr(owner, name, wrapped)


if __name__ == "__main__":
    arm(json.loads(os.environ["STAGE"]))
    sys.exit(main())
