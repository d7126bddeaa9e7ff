"""The supervisor's side of a render child: starts it, sends requests, and notices its death."""

import logging
import os
import selectors
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from plateau.farm.images.channels import Channels
from plateau.farm.images.mattes import check_attributes
from plateau.farm.images.view_transform import ViewTransform
from plateau.farm.model.renderers import variant_named
from plateau.farm.model.seeds import Pass
from plateau.farm.model.slices.zones import Zone, pixels_of
from plateau.farm.process.lifecycle import how_ended
from plateau.worker.renderers import contract
from plateau.worker.renderers.causes import first_and_last_words, without_folders
from plateau.worker.renderers.contract import Answer, Loaded, Request, SceneError
from plateau.worker.supervisor.child_start import ChildLimits, start_child
from plateau.worker.supervisor.child_watch import STILL_S, ChildWatch
from plateau.worker.supervisor.scene_cache import loading_threads

_LOG = logging.getLogger(__name__)

_A = TypeVar("_A", bound=Answer)

#: A sum of passes before it is divided by its weights: (height, width, channels).
Film = NDArray[np.float32]

#: A cancelled render that is still running after this time is killed.
CANCEL_GRACE_S: Final = 2.0

#: A child that has not imported its renderer by then is killed.
START_TIMEOUT_S: Final = 120.0
_POLL_S: Final = 0.5  #: between two checks of a silent child


class ChildDied(Exception):
    """The render child is dead; the message says how it ended, with its last words."""


class Cancelled(Exception):
    """The request was cancelled; the child may have been killed."""


class RenderChild:
    """A child process with a renderer in it, kept alive between slices.

    It speaks the protocol of `plateau.worker.renderers.contract`.

    The constructor does not wait until the child has started, which takes a second. The child can
    open scenes in the folders `scenes`, and writes into `home` alone; see
    `plateau.worker.confinement.confine`.

    Every request raises `ChildDied` if the process ends, breaks the protocol, is stuck, or does not
    answer in time (its whole process group is then killed). It raises `SceneError` with the
    renderer's message, and `OSError` if the disk of `home` takes no film; the scene then has to be
    loaded again. After `cancel`, in another thread, the current request raises `Cancelled`.
    """

    def __init__(
        self,
        variant: str,
        llvm_library: str | None,
        limits: ChildLimits,
        home: Path,
        scenes: Iterable[Path],
    ) -> None:
        self._limits = limits
        self._request_id = 0
        self._scene: Loaded | None = None
        self.notes: tuple[str, ...] = ()  #: on the last film
        self.inputs: dict[int, Film] = {}  #: the sums on the way to it, by their spp
        self._cancelled_at: float | None = None
        self._lock = threading.Lock()
        self._home = home
        self._folder: Path | None = None  # of its scene
        home.mkdir(parents=True, exist_ok=True)
        # A file without a name: nothing of it remains, whichever process dies.
        self._films = tempfile.TemporaryFile(dir=home, buffering=0)  # noqa: SIM115  (as the words)
        self._child = start_child(self._films.fileno(), variant, llvm_library, limits, home, scenes)
        self._child.link.settimeout(STILL_S)
        self._watch = ChildWatch(self.pid, on_gpu=variant_named(variant).on_gpu)
        self._readable = selectors.DefaultSelector()
        self._readable.register(self._child.link, selectors.EVENT_READ)
        self._received = b""
        self._is_ready = False

    @property
    def pid(self) -> int:
        """The child's process id."""
        return self._child.pid

    @property
    def trouble(self) -> str | None:
        """What is wrong with the child while it owes an answer; see `ChildWatch`."""
        return self._watch.trouble

    def await_ready(self) -> None:
        """Return once the child has imported its renderer; `load` waits for this by itself."""
        if self._is_ready:
            return
        ready = self._expect(START_TIMEOUT_S, "starting", contract.Ready)
        for what in ready.stays_open:
            _LOG.warning("the render child is not confined: %s", what)
        self._is_ready = True

    def load(
        self,
        folder: Path,
        entry: str,
        parameters: dict[str, str],
        sensor: int,
        aovs: tuple[str, ...] = (),
    ) -> Loaded:
        """Load a scene, which takes the place of the one before."""
        self._folder = folder.absolute()  # the child works in another
        self._ask(
            contract.Load(
                folder=str(self._folder),
                entry=entry,
                parameters=parameters,
                sensor=sensor,
                aovs=aovs,
                threads=loading_threads(folder),
            )
        )
        self.await_ready()
        scene = self._expect(self._limits.timeout_s, "loading the scene", Loaded)
        try:
            channels = Channels(scene.channels, scene.ids, scene.quotients)
            channels.check_size(scene.width, scene.height)
            if scene.look:
                ViewTransform.from_text(scene.look)
            check_attributes(scene.header)
        except ValueError as error:  # an honest child says nothing of the kind
            self.kill()
            raise ChildDied(f"the render process said {scene!r}: {error}") from error
        self._scene = scene
        self._watch.new_scene()
        return scene

    def render(
        self,
        passes: tuple[Pass, ...],
        show: Callable[[Film, int], None] | None = None,
        zones: Sequence[Zone] = (),
        inputs: Sequence[int] = (),
    ) -> tuple[Film, float]:
        """Return the sum of these passes, in float32, and its seconds.

        If the passes take a while, `show` is called with the film of the first and its spp. Of
        zones the film is (pixels, channels), as `contract.Renderer.render` says. The sums of the
        first passes that have the spp of `inputs` are in the attribute of that name afterwards.
        """
        assert self._scene is not None
        pixels = pixels_of(zones) if zones else self._scene.width * self._scene.height
        samples = pixels * max(one.spp for one in passes)
        limit_s = self._watch.limit_s(self._limits.timeout_s, samples)
        self.inputs = {}
        self._ask(
            contract.Render(passes=passes, glimpse=show is not None, zones=zones, inputs=inputs)
        )
        while True:
            began = time.monotonic()
            answer = self._next_answer(limit_s, "rendering a pass")
            self._watch.took(time.monotonic() - began)
            if isinstance(answer, contract.FirstPass) and show is not None:
                show(self._film(self._scene, zones, answer.at), answer.spp)
            elif isinstance(answer, contract.InputDone) and answer.spp in inputs:
                self.inputs[answer.spp] = self._film(self._scene, (), answer.at)
            elif isinstance(answer, contract.SumDone):
                self._watch.ended(samples)
                self.notes = answer.notes
                return self._film(self._scene, zones, answer.at), answer.render_s

    def _film(self, scene: Loaded, zones: Sequence[Zone], at: int) -> Film:
        shape: tuple[int, ...] = (scene.height, scene.width)
        if zones:
            bordered = (one.with_border(scene.border, scene.width, scene.height) for one in zones)
            shape = (pixels_of(bordered),)
        film = np.empty((*shape, len(scene.channels)), np.float32)
        # By position: the place in the file is the child's, which may be writing.
        if os.preadv(self._films.fileno(), [film.data], at) < film.nbytes:
            self.kill()
            raise ChildDied("the render process left a film that is cut short")
        return film

    def take_words(self) -> str:
        """Return the end of what the child printed since the last call; see `Words.take`."""
        return self._told(self._child.words.take())

    def cancel(self) -> None:
        """Cancel the current request at the end of its pass; kill the child if that takes long."""
        if not self._lock.acquire(timeout=_POLL_S):  # it reads no request; heartbeats ask again
            return
        try:
            if self._cancelled_at is None:
                self._cancelled_at = time.monotonic()
                self._send(contract.Cancel(id=self._request_id))
        except OSError:
            pass  # it is dead or stuck, which the next read sees
        finally:
            self._lock.release()

    @property
    def alive(self) -> bool:
        """Whether the process is still running."""
        return self._child.is_alive

    def kill(self) -> None:
        """Kill the child and all that it has started.

        One that waits for a disk that does not answer ends when the disk answers.
        """
        self._child.end()
        self._watch.answered()
        self._readable.close()
        self._films.close()

    def _ask(self, request: contract.Load | contract.Render) -> None:
        with self._lock:
            self._cancelled_at = None
            self._request_id += 1
            try:
                self._send(replace(request, id=self._request_id))
            except TimeoutError as error:  # a request of many zones is longer than a socket holds
                self.kill()
                raise ChildDied(f"the render process read no request for {STILL_S:g} s") from error
            except OSError:
                pass  # it is dead, and the next read says how it ended

    def _send(self, request: Request) -> None:
        self._child.link.sendall(contract.request_line(request).encode())

    def _expect(self, timeout_s: float, doing: str, kind: type[_A]) -> _A:
        """Return the next answer, which has to be of this kind."""
        answer = self._next_answer(timeout_s, doing)
        if not isinstance(answer, kind):
            self.kill()
            raise ChildDied(f"the render process said {answer!r} while {doing}")
        return answer

    def _next_answer(self, timeout_s: float, doing: str) -> Answer:
        """Return the next answer to the request; see the class for its errors."""
        deadline = time.monotonic() + timeout_s
        self._watch.asked()
        while b"\n" not in self._received:
            # First, so that an answer that has come counts, however late this process gets to it.
            arrived = self._receive(doing)
            if b"\n" in self._received:
                break
            now, cancelled_at = time.monotonic(), self._cancelled_at
            if cancelled_at is not None and now > cancelled_at + CANCEL_GRACE_S:
                self.kill()
                raise Cancelled
            if now > deadline:
                self.kill()
                raise ChildDied(f"{doing} took longer than {timeout_s:.3g} s")
            if not arrived and (why := self._watch.stuck()) is not None:
                self.kill()
                raise ChildDied(f"the render process {why} while {doing}")
        self._watch.answered()
        line, _, self._received = self._received.partition(b"\n")
        try:
            answer = contract.read_answer(line)
        except contract.NotUnderstood as error:
            self.kill()
            raise ChildDied(f"{error} (while {doing})") from error
        if isinstance(answer, contract.SceneRefused):
            raise SceneError(self._told(answer.message))
        if isinstance(answer, contract.Failed):
            self.kill()
            why = self._told(answer.message)
            raise ChildDied(f"the render process failed while {doing}: {why}")
        if isinstance(answer, contract.DiskFull):
            raise OSError(f"no film can be written into {self._home}: {answer.message}")
        if isinstance(answer, contract.Stopped):
            raise Cancelled
        return answer

    def _receive(self, doing: str) -> bool:
        """Read what has arrived, if anything; raise `ChildDied` at the end of the stream."""
        if not self._readable.select(_POLL_S):
            return False
        try:
            chunk = self._child.link.recv(65536)
        except OSError:
            chunk = b""
        if not chunk:
            how, words = how_ended(self._child.wait()), self._last_words()
            self.kill()  # its group may live on
            raise ChildDied(f"the render process {how} while {doing}{words}")
        self._received += chunk
        return True

    def _last_words(self) -> str:
        words = first_and_last_words(self._told(self._child.words.read()))
        return f": {words}" if words else ""

    def _told(self, words: str) -> str:
        """Return what the child said, without this machine's folders."""
        legible = words.encode(errors="replace").decode()  # a path may have any bytes
        return without_folders(legible, filter(None, (self._folder, self._home)))
