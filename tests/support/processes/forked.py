"""Processes forked from one that has imported Plateau: real ones, which start a second sooner.

They are `python -m plateau` but for that: with an environment, a session and signals of their own.
What is tested of a start, of memory or of a power loss takes plain processes.
"""

import gc
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from plateau.farm.process.lifecycle import die_with_parent

#: What the commands of a farm import when they are run.
_MODULES: Final = (
    *("plateau.commands.serve", "plateau.processes.process", "plateau.processes.standing"),
    *("plateau.service.api.process", "plateau.service.monitor.monitor"),
    "plateau.worker.supervisor.supervisor",
)
#: The modules whose main they can be.
FORKED: Final = ("plateau", "tests.support.faults.stages")
_MOST: Final = 1 << 17  #: bytes of a message: an environment


class Forked(subprocess.Popen[bytes]):
    """A child of the server's, as if it were one of ours."""

    def __init__(self, server: "ForkServer", pid: int, arguments: tuple[str, ...]) -> None:
        self.pid, self.args, self.returncode = pid, arguments, None  # type: ignore[assignment]
        self._server = server

    def __del__(self, *_: object) -> None:
        """There is nothing that the server would not do."""

    def poll(self) -> int | None:
        if self.returncode is None:
            self.returncode = self._server.ask({"pid": self.pid})
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        deadline = time.monotonic() + (timeout or float("inf"))
        while (code := self.poll()) is None:
            if time.monotonic() > deadline:
                raise subprocess.TimeoutExpired(self.args, timeout or 0)
            time.sleep(0.01)
        return code


class ForkServer:
    """Starts processes by forking one that has imported all; it ends with `stop`, as they do."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            command = [sys.executable, "-m", __name__, str(theirs.fileno())]
            passed = [theirs.fileno()]
            self._process = subprocess.Popen(
                command, pass_fds=passed, start_new_session=True, cwd=Path(__file__).parents[3]
            )

    def start(
        self, arguments: tuple[str, ...], environment: dict[str, str], passed: tuple[int, ...]
    ) -> Forked:
        """Run ``plateau`` with these arguments; the descriptors keep their numbers."""
        about = {"arguments": arguments, "environment": environment, "passed": passed}
        return Forked(self, self.ask({**about, "folder": str(Path.cwd())}, passed), arguments)

    def ask(self, about: dict[str, Any], passed: tuple[int, ...] = ()) -> Any:
        """Return the server's answer."""
        with self._lock:
            socket.send_fds(self._socket, [json.dumps(about).encode()], passed)
            return json.loads(self._socket.recv(_MOST))

    def stop(self) -> None:
        self._socket.close()
        assert self._process.wait(60) == 0


@cache
def fork_server() -> ForkServer | None:
    """The one of this process, for farms whose starts nobody tests."""
    return ForkServer() if sys.platform == "linux" else None


def end_fork_server() -> None:
    if fork_server.cache_info().currsize and (server := fork_server()):
        server.stop()


def _serve(connection: socket.socket) -> dict[str, Any] | None:
    """Answer until nobody can ask any more; in a forked process, return what it is to be."""
    arrange = die_with_parent(signal.SIGKILL)
    while True:
        message, received, *_ = socket.recv_fds(connection, _MOST, 8)
        if not message:
            return None
        asked: dict[str, Any] = json.loads(message)
        if "pid" in asked:
            ended, status = os.waitpid(asked["pid"], os.WNOHANG)
            answer = os.waitstatus_to_exitcode(status) if ended else None
        elif answer := os.fork():
            for descriptor in received:
                os.close(descriptor)
        else:
            arrange()
            threading.main_thread()._set_native_id()  # type: ignore[attr-defined]  # Python does not
            connection.close()
            for ours, theirs in zip(received, asked["passed"], strict=True):
                os.dup2(ours, theirs)
                if ours != theirs:
                    os.close(ours)
            return asked
        connection.send(json.dumps(answer).encode())


def main() -> None:
    """Import Plateau, serve, and be what was asked for in each process that is forked."""
    for module in _MODULES:
        import_module(module)
    gc.freeze()
    asked = _serve(socket.socket(fileno=int(sys.argv[1])))
    if asked is not None:
        os.setsid()
        os.chdir(asked["folder"])
        os.environ.clear()
        os.environ.update(asked["environment"])
        sys.argv = ["plateau", *asked["arguments"]]
        if "STAGE" in os.environ:
            import_module("tests.support.faults.stages").arm(json.loads(os.environ["STAGE"]))
        import_module("plateau.commands").main()


if __name__ == "__main__":
    main()
