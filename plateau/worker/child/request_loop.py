"""The loop of a render child: it reads its supervisor's requests, renders, and answers.

The messages are those of `plateau.worker.renderers.contract`. The child ends when the stream of
requests ends, even in the middle of a pass: it never outlives its supervisor.
"""

import contextlib
import os
import queue
import socket
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from typing import Final, TextIO

import numpy as np
from numpy.typing import NDArray

from plateau.farm.images.channels import Channels
from plateau.farm.model.slices.zones import Zone
from plateau.worker.child.films import Films, FilmsNotWritten
from plateau.worker.renderers.causes import first_words
from plateau.worker.renderers.contract import (
    Answer,
    Cancel,
    DiskFull,
    Failed,
    FirstPass,
    InputDone,
    KnowsBlack,
    Load,
    Loaded,
    Ready,
    Render,
    Renderer,
    SceneError,
    SceneRefused,
    Stopped,
    SumDone,
    Working,
    answer_line,
    read_request,
    renderer_for,
)

#: A first pass is shown only if the rest of the slice takes longer.
_GLIMPSE_S: Final = 0.3


class Requests:
    """The requests, read by a thread of their own so that a cancel is seen during a render."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._waiting: queue.SimpleQueue[Load | Render] = queue.SimpleQueue()
        self.cancelled_id = 0
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        with contextlib.suppress(OSError):
            for line in self._stream:
                request = read_request(line)
                if isinstance(request, Cancel):
                    self.cancelled_id = request.id
                else:
                    self._waiting.put(request)
        os._exit(0)  # whatever the other threads are doing

    def __iter__(self) -> Iterator[Load | Render]:
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
        A variant of `plateau.farm.model.renderers`.
    threads : int
        Threads that render.
    stays_open : list of str
        What does not confine this process, a sentence each.
    """
    connection = socket.socket(fileno=socket_fd)
    requests = Requests(connection.makefile("r", encoding="utf-8"))
    answers = connection.makefile("w", encoding="utf-8")

    def answer(one: Answer) -> None:
        answers.write(answer_line(one))
        answers.flush()

    films = Films(os.fdopen(films_fd, "wb", buffering=0))
    # The import may take a second; by now the child notices if its supervisor dies.
    renderer = renderer_for(variant, threads)
    answer(Ready(stays_open=stays_open))
    channels = Channels()
    for request in requests:
        try:
            if isinstance(request, Load):
                os.chdir(request.folder)
                scene = renderer.load(request)
                channels = _channels(scene)
                films.make_room(scene.width, scene.height, len(channels.names))
                answer(scene)
            else:
                _render(renderer, channels, request, requests, answer, films)
        except SceneError as error:
            answer(SceneRefused(message=str(error)))
        except FilmsNotWritten as error:
            answer(DiskFull(message=str(error)))
        except Exception as error:
            traceback.print_exception(error)
            what = "out of memory" if isinstance(error, MemoryError) else type(error).__name__
            answer(Failed(message=f"{what}: {first_words(str(error))}"))
            raise SystemExit(1) from error


def _channels(scene: Loaded) -> Channels:
    try:
        channels = Channels(scene.channels, scene.ids, scene.quotients)
        channels.check_size(scene.width, scene.height)
    except ValueError as error:  # a scene may name its own AOVs
        raise SceneError(f"the film cannot be stored: {error}") from error
    return channels


def _render(
    renderer: Renderer,
    channels: Channels,
    request: Render,
    requests: Requests,
    answer: Callable[[Answer], None],
    films: Films,
) -> None:
    """Write the sum of the passes, added in order in float64, and answer; or answer a cancel."""
    started = time.monotonic()
    total: NDArray[np.float64] | None = None
    summed = 0
    passes = request.passes
    films.drop_glimpse()

    def is_cancelled() -> bool:
        answer(Working())
        return requests.cancelled_id == request.id

    zones = [Zone(*one) for one in request.zones]
    for film in renderer.render(passes, zones=zones, is_cancelled=is_cancelled):
        total = channels.add(total, film)
        summed += 1
        if summed == 1 and request.glimpse:
            first_s, (spp, _) = time.monotonic() - started, passes[0]
            takes_a_while = first_s / spp * sum(spp for spp, _ in passes[1:]) > _GLIMPSE_S
            if takes_a_while and (at := films.write_glimpse(film)) is not None:
                answer(FirstPass(at=at, spp=spp))
        spp = sum(spp for spp, _ in passes[:summed])
        if spp in request.inputs:
            at = films.write_input(request.inputs.index(spp), total.astype(np.float32))
            answer(InputDone(at=at, spp=spp))
    if total is None or summed < len(passes):
        answer(Stopped())
    else:
        at = films.write_sum(total.astype(np.float32))
        render_s = time.monotonic() - started
        notes: tuple[str, ...] = ()
        if isinstance(renderer, KnowsBlack) and not total[..., :3].any():
            notes = (renderer.why_black(zones),)
        answer(SumDone(at=at, render_s=render_s, notes=notes))
