"""Processes that a test starts die with it, however the process of the tests ends.

A killed pytest runs no fixture's end. So the kernel kills what it has started (`PR_SET_PDEATHSIG`),
and what that has started itself goes as it does where its parent is killed in earnest. What has
left its parent, as daemons do, is killed by a guard: a process that waits for the end of this one,
and knows the others by a mark in their environment.
"""

import functools
import multiprocessing
import os
import secrets
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, Final
from unittest.mock import patch

from plateau.farm.process.lifecycle import die_with_parent

#: What the guard does, once nobody is left who could write to it.
_GUARD: Final = """
import os, signal, sys, time
sys.stdin.buffer.read()
mark, found = sys.argv[1].encode() + b"=", True
while found:
    found = False
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{pid}/environ", "rb") as file:
                if mark in file.read():
                    os.kill(int(pid), signal.SIGKILL)
                    found = True
        except OSError:
            pass
    time.sleep(0.05)
"""


@contextmanager
def own_processes() -> Iterator[None]:
    """Whatever `subprocess` starts in this process meanwhile is killed when this one dies."""
    begin = subprocess.Popen.__init__
    with _guard(), ThreadPoolExecutor(1, thread_name_prefix="starter") as starter:

        @functools.wraps(begin)
        def begin_as_own(
            process: Any, *arguments: Any, preexec_fn: Any = None, **options: Any
        ) -> None:
            act = functools.partial(
                begin, process, *arguments, preexec_fn=_own_after(preexec_fn), **options
            )
            if threading.current_thread() is threading.main_thread():
                act()
            else:  # its children are killed when the thread ends that has started them
                starter.submit(act).result()

        with patch.object(subprocess.Popen, "__init__", begin_as_own):
            yield


@contextmanager
def _guard() -> Iterator[None]:
    mark = f"TESTS_OF_{secrets.token_hex(8)}"
    command = [sys.executable, "-I", "-S", "-c", _GUARD, mark]
    with subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True):
        os.environ[mark] = "1"
        try:
            yield
        finally:
            del os.environ[mark]


def _own_after(prepare: Callable[[], object] | None) -> Callable[[], None]:
    arrange = die_with_parent(signal.SIGKILL)

    def prepare_and_arrange() -> None:
        if prepare is not None:
            prepare()
        arrange()

    return prepare_and_arrange


def end_with_parent() -> None:
    """Have this process end when the one does that started it by `multiprocessing`."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def end() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=end, name="end-with-parent", daemon=True).start()
