"""When a farm's render children come to rest, seen from outside: by their CPU time."""

from __future__ import annotations

import threading
import time
from contextlib import suppress
from typing import TYPE_CHECKING

import psutil

if TYPE_CHECKING:
    from types import TracebackType

#: Between two looks; the kernel counts CPU time in hundredths of a second.
_LOOK_S = 0.01
#: A child that spent nothing for so long is idle: its shortest pause at work is far shorter.
_REST_S = 0.4


class RenderChildren:
    """Watches the render children below a process while the context lasts."""

    def __init__(self, pid: int) -> None:
        self._root = psutil.Process(pid)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._spent = 0.0
        self._changed_at = time.time()
        self._looked_at = 0.0
        self._children: list[psutil.Process] = []

    def __enter__(self) -> RenderChildren:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._over.set()
        self._thread.join()

    def idle_since(self) -> float:
        """When they last spent anything, in seconds of `time.time`; waits until they are idle."""
        while time.time() < self._changed_at + _REST_S:
            time.sleep(_LOOK_S)
        return self._changed_at

    def _watch(self) -> None:
        while not self._over.wait(_LOOK_S):
            now = time.time()
            if now > self._looked_at + 1.0 or not all(one.is_running() for one in self._children):
                self._children = _render_children(self._root)
                self._looked_at = now
            spent = 0.0
            for child in self._children:
                with suppress(psutil.NoSuchProcess):  # it ended a moment ago
                    times = child.cpu_times()
                    spent += times.user + times.system
            if spent != self._spent:
                self._spent, self._changed_at = spent, now


def _render_children(root: psutil.Process) -> list[psutil.Process]:
    found = []
    for process in root.children(recursive=True):
        with suppress(psutil.NoSuchProcess):
            if "plateau.worker.child" in process.cmdline():
                found.append(process)
    return found
