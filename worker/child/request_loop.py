"""What a render child does: it answers its supervisor's requests, and renders meanwhile.

It speaks JSON lines over the socket that it inherits, beside a file for films. Requests::

    {"do": "load", "id": 1, "folder": …, "entry": …, "parameters": {…}, "sensor": 0,
     "threads": 1}                     that load it
    {"do": "render", "id": 2, "passes": [[spp, seed], …], "glimpse": false}
    {"do": "cancel", "id": 2}              at the end of its pass; too late is harmless

and answers::

    {"is": "ready", "stays_open": […]}     once, when Mitsuba is imported: what does not confine it
    {"is": "loaded", "width": …, "height": …, "notes": […]}
    {"is": "pass"}                         after each pass, so that a hang is noticed
    {"is": "glimpse", "at": …, "spp": …}   the first pass, if asked for and the others take a while
    {"is": "rendered", "at": …, "render_s": …}     the sum of the passes
    {"is": "cancelled"}
    {"is": "scene-error", "message": …}    Mitsuba's words
    {"is": "disk-error", "message": …}     to either request: the machine's disk takes no film

A film lies in the file as height × width × 4 values in float32, from the byte ``"at"`` on, until
the next request to render.

The end of the stream is the end of the child, in the middle of a pass too: it never outlives its
supervisor.
"""

import contextlib
import json
import os
import queue
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, TextIO

import numpy as np

from plateau.worker.child.films import Films, FilmsNotWritten
from plateau.worker.renderers.errors import SceneError

#: Where the rest of a slice takes less, its first pass is not worth showing.
_GLIMPSE_S: Final = 0.3


class Requests:
    """Requests as they come in, read by a thread of their own so that a cancel overtakes."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._waiting: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self.cancelled_id = 0
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        with contextlib.suppress(OSError):
            for line in self._stream:
                request = json.loads(line)
                if request["do"] == "cancel":
                    self.cancelled_id = request["id"]
                else:
                    self._waiting.put(request)
        os._exit(0)  # whatever the other threads are doing

    def __iter__(self) -> Iterator[dict[str, Any]]:
        while True:
            yield self._waiting.get()


def serve(
    socket_fd: int, films_fd: int, *, variant: str, threads: int, stays_open: list[str]
) -> None:
    """Answer requests until the supervisor closes the socket.

    Parameters
    ----------
    socket_fd, films_fd : int
        The inherited socket, and the inherited file for films.
    variant : str
        The Mitsuba variant.
    threads : int
        Threads that render.
    stays_open : list of str
        What does not confine this process, a sentence each.
    """
    connection = socket.socket(fileno=socket_fd)
    requests = Requests(connection.makefile("r", encoding="utf-8"))
    answers = connection.makefile("w", encoding="utf-8")

    def answer(what: str, **details: object) -> None:
        answers.write(json.dumps({"is": what, **details}) + "\n")
        answers.flush()

    # Imported here: it takes a second, and the supervisor's death must be noticed meanwhile.
    from plateau.worker.renderers.mitsuba.renderer import Renderer

    films = Films(os.fdopen(films_fd, "wb", buffering=0))
    renderer = Renderer(variant, threads)
    answer("ready", stays_open=stays_open)
    for request in requests:
        try:
            if request["do"] == "load":
                os.chdir(request["folder"])
                scene = renderer.load(
                    Path(request["folder"]),
                    request["entry"],
                    request["parameters"],
                    request["sensor"],
                    threads=request["threads"],
                )
                films.make_room(scene.width, scene.height)
                answer("loaded", width=scene.width, height=scene.height, notes=scene.notes)
            else:
                _render(renderer, request, requests, answer, films)
        except SceneError as error:
            answer("scene-error", message=str(error))
        except FilmsNotWritten as error:
            answer("disk-error", message=str(error))


def _render(
    renderer: Any, request: dict[str, Any], requests: Requests, answer: Any, films: Films
) -> None:
    """Sum the passes, in order, in float64, into the file of films; say so, or of a cancel."""
    started = time.monotonic()
    total, summed = np.zeros(1), 0
    passes = request["passes"]
    films.drop_glimpse()
    for film in renderer.render(
        passes, is_cancelled=lambda: requests.cancelled_id == request["id"]
    ):
        total = np.add(total, film, out=total if total.shape == film.shape else None)
        summed += 1
        answer("pass")
        if summed == 1 and request["glimpse"]:
            first_s, (spp, _) = time.monotonic() - started, passes[0]
            takes_a_while = first_s / spp * sum(spp for spp, _ in passes[1:]) > _GLIMPSE_S
            if takes_a_while and (at := films.write_glimpse(film)) is not None:
                answer("glimpse", at=at, spp=spp)
    if summed < len(passes):
        answer("cancelled")
    else:
        at = films.write_sum(total.astype(np.float32))
        answer("rendered", at=at, render_s=time.monotonic() - started)
