"""Processes of a farm that are forked from one that has imported Plateau: the *nursery*.

To start one takes a second of a core or two, nearly all of it for imports. What is forked runs its
module as ``python -m`` does, in a session of its own; its signals, its descriptors and its end are
those of any other process. Only its memory is shared with the nursery's, as far as neither writes.
"""

import atexit
import contextlib
import fcntl
import functools
import gc
import json
import os
import runpy
import selectors
import signal
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from plateau.farm.process.lifecycle import die_with_parent

_ABOVE_ALL_OTHERS: Final = 200  #: descriptors that are passed are moved here at first
_ANSWER: Final = struct.Struct("!i")  #: a process id, and later an exit status
_ASKING: Final = threading.Lock()


class Forked(subprocess.Popen[bytes]):
    """A process that the nursery has forked."""

    def __init__(self, arguments: list[str], end: socket.socket) -> None:
        self.args, self.stdin, self.stdout, self.stderr = arguments, None, None, None
        self.returncode: Any = None
        self._end = end
        [self.pid] = _ANSWER.unpack(end.recv(_ANSWER.size, socket.MSG_WAITALL))

    def poll(self) -> int | None:
        try:
            return self.wait(0)
        except subprocess.TimeoutExpired:
            return None

    def wait(self, timeout: float | None = None) -> int:
        if self.returncode is None:
            self._end.settimeout(timeout)
            try:
                said = self._end.recv(_ANSWER.size)
            except (TimeoutError, BlockingIOError):
                raise subprocess.TimeoutExpired(self.args, timeout or 0) from None
            # Without its nursery it was killed
            self.returncode = _ANSWER.unpack(said)[0] if said else -signal.SIGKILL
            self._end.close()
        return int(self.returncode)

    def __del__(self) -> None:
        self._end.close()


def fork(
    module: str, arguments: tuple[str, ...], environment: Mapping[str, str], passed: tuple[int, ...]
) -> Forked:
    """Run a module with these arguments and descriptors, as ``python -m`` would.

    Its output goes where this process's does at the moment.
    """
    ours, theirs = socket.socketpair()
    descriptors = [1, 2, *passed]
    about = {
        "argv": [module, *arguments],
        "environment": dict(environment),
        "folder": str(Path.cwd()),
        "descriptors": descriptors,
    }
    with theirs, _ASKING:
        socket.send_fds(_nursery(), [json.dumps(about).encode()], [theirs.fileno(), *descriptors])
        return Forked(about["argv"], ours)


@functools.cache
def _nursery() -> socket.socket:
    """The way to this process's nursery, which ends with it."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with theirs:
        command = [sys.executable, "-m", __name__, str(theirs.fileno())]
        process = subprocess.Popen(command, pass_fds=[theirs.fileno()], start_new_session=True)

    def end() -> None:
        ours.close()
        process.wait()

    atexit.register(end)
    return ours


class _Nursery:
    """Forks what is asked for by `link`, and tells of each process how it ended."""

    def __init__(self, link: socket.socket) -> None:
        self._link = link
        self._selector = selectors.DefaultSelector()
        self._selector.register(link, selectors.EVENT_READ)
        #: Process ids, and who waits for their ends, by a descriptor of the process.
        self._running: dict[int, tuple[int, socket.socket]] = {}

    def serve(self) -> dict[str, Any]:
        """Return in each child, with what it is to be; end when nobody can ask any more."""
        while True:
            for key, _ in self._selector.select():
                about = self._fork() if key.fileobj is self._link else self._tell(key.fd)
                if about is not None:
                    return about

    def _fork(self) -> dict[str, Any] | None:
        message, descriptors, _, _ = socket.recv_fds(self._link, 2**20, 16)
        if not message:
            raise SystemExit
        end, passed = socket.socket(fileno=descriptors[0]), descriptors[1:]
        pid = os.fork()
        if pid == 0:
            about: dict[str, Any] = json.loads(message)
            for other in (end, self._link, self._selector, *self._waiting()):
                other.close()
            for process in self._running:
                os.close(process)
            _place(passed, about["descriptors"])
            return about
        for descriptor in passed:
            os.close(descriptor)
        end.send(_ANSWER.pack(pid))
        process = os.pidfd_open(pid)
        self._running[process] = pid, end
        self._selector.register(process, selectors.EVENT_READ)
        return None

    def _waiting(self) -> list[socket.socket]:
        return [end for _, end in self._running.values()]

    def _tell(self, process: int) -> None:
        self._selector.unregister(process)
        os.close(process)
        pid, end = self._running.pop(process)
        status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        with end, contextlib.suppress(BrokenPipeError):  # perhaps nobody waits for it any more
            end.send(_ANSWER.pack(status))


def _place(descriptors: list[int], numbers: list[int]) -> None:
    """Give descriptors the numbers that they had where they came from."""
    moved = [fcntl.fcntl(one, fcntl.F_DUPFD, _ABOVE_ALL_OTHERS) for one in descriptors]
    for one in descriptors:
        os.close(one)
    for one, number in zip(moved, numbers, strict=True):
        os.dup2(one, number, inheritable=True)
        os.close(one)


def main() -> None:
    import plateau.commands.serve
    import plateau.service.api.process
    import plateau.service.monitor.monitor
    import plateau.worker.supervisor.supervisor  # noqa: F401

    gc.freeze()
    arrange_its_end = die_with_parent(signal.SIGKILL)
    about = _Nursery(socket.socket(fileno=int(sys.argv[1]))).serve()
    # From here on this is another process
    os.setsid()
    arrange_its_end()
    os.chdir(about["folder"])
    os.environ.clear()
    os.environ.update(about["environment"])
    module, *sys.argv[1:] = about["argv"]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
