"""The render child: the process that hosts Mitsuba, and may die of it.

It speaks JSON lines over the socket that it inherits, beside a file for films. Requests::

    {"do": "load", "id": 1, "folder": …, "entry": …, "parameters": {…}, "sensor": 0}
    {"do": "render", "id": 2, "passes": [[spp, seed], …], "glimpse": false}
    {"do": "cancel", "id": 2}              at the end of its pass; too late is harmless

and answers::

    {"is": "ready", "unconfined": …}       once, when Mitsuba is imported; null, or what is missing
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

import argparse
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

from worker.confinement import limit_resources, refuse_processes_and_network
from worker.errors import SceneError
from worker.films import Films, FilmsNotWritten

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


def main() -> None:
    """Serve requests until the supervisor closes the socket."""
    parser = argparse.ArgumentParser(description="Plateau's render child; started by the worker.")
    parser.add_argument("--socket", type=int, required=True)
    parser.add_argument("--films", type=int, required=True)
    parser.add_argument("--variant", required=True)
    parser.add_argument("--threads", type=int, required=True)
    parser.add_argument("--memory-bytes", type=int, required=True)
    parser.add_argument("--open-files", type=int, required=True)
    parser.add_argument("--file-bytes", type=int, required=True)
    arguments = parser.parse_args()
    limit_resources(arguments.memory_bytes, arguments.open_files, arguments.file_bytes)
    os.chdir(os.environ["HOME"])  # until there is a scene, whose folder it works in

    connection = socket.socket(fileno=arguments.socket)
    requests = Requests(connection.makefile("r", encoding="utf-8"))
    answers = connection.makefile("w", encoding="utf-8")

    def answer(what: str, **details: object) -> None:
        answers.write(json.dumps({"is": what, **details}) + "\n")
        answers.flush()

    # Imported here: it takes a second, and the supervisor's death must be noticed meanwhile.
    from worker.renderer import Renderer

    films = Films(os.fdopen(arguments.films, "wb", buffering=0))
    renderer = Renderer(arguments.variant, arguments.threads)
    answer("ready", unconfined=_confine(arguments.variant))
    for request in requests:
        try:
            if request["do"] == "load":
                os.chdir(request["folder"])
                scene = renderer.load(
                    Path(request["folder"]),
                    request["entry"],
                    request["parameters"],
                    request["sensor"],
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


def _confine(variant: str) -> str | None:
    """Refuse what rendering has no use for; return why not, if not."""
    if variant.startswith("cuda"):
        return "CUDA's driver was never tried under the filter"
    return refuse_processes_and_network()


if __name__ == "__main__":
    main()
