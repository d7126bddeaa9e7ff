"""When a farm's render children become idle, observed by their CPU time."""

from __future__ import annotations

import threading
import time
from contextlib import suppress
from typing import TYPE_CHECKING

import psutil

if TYPE_CHECKING:
    pass

#: Between two readings; the kernel counts CPU time in hundredths of a second.
_LOOK_S = 0.01
#: A child that used no CPU time for this long is idle: its pauses at work are far shorter.
_REST_S = 0.4


class RenderChildren:
    """Watches the render children among a process's descendants while the context lasts."""

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

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def idle_since(self) -> float:
        """Wait until they are idle; return when they last used CPU time, as `time.time`."""
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
