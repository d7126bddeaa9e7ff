"""The monitor's side of the process that denoises: it starts one for each image, in turn."""

import io
import os
import signal
import subprocess
import sys
import threading
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Final

from plateau.farm.process.lifecycle import die_with_parent, plain_environment
from plateau.service.judging.denoised import Denoised, DenoisingTask
from plateau.service.monitor.denoising import child

#: Seconds that an image may take, and how many more for each pixel: some twenty times what two
#: cores need.
_DEADLINE_S: Final = (60.0, 2e-4)
#: Bytes of memory that the process takes, and those for each pixel.
_MEMORY: Final = (7e7, 430.0)
#: Those of the network for each pixel, and where it begins to denoise in tiles.
_NETWORK: Final = (610.0, 2e9)


def memory_bytes() -> int:
    """Return how much memory this machine has."""
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


class DenoisingFailed(Exception):
    """The process did not answer; it may if it is asked again."""


class TooLarge(Exception):
    """This machine has not the memory for the image."""


class Denoising:
    """Denoises images one after the other, each in a process of its own."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="denoising")
        self._jobs: dict[Future[Denoised], str] = {}  # of the images that are not noted as done
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._is_closed = False

    @property
    def is_busy(self) -> bool:
        """Whether an image is being denoised, or is done and not yet noted."""
        return bool(self._jobs)

    def start(self, job_id: str, task: DenoisingTask) -> "Future[Denoised]":
        """Return the future image of a job; it fails with `DenoisingFailed`.

        Raises
        ------
        TooLarge
            No process could denoise it.
        """
        height, width = task.image.shape[:2]
        pixels, here = height * width, memory_bytes()
        needed = _MEMORY[0] + _MEMORY[1] * pixels + min(_NETWORK[0] * pixels, _NETWORK[1])
        if needed > here:
            raise TooLarge(
                f"{width}×{height} pixels take {needed / 1e9:.1f} GB of memory to denoise, and the "
                f"monitor's machine has {here / 1e9:.1f} GB"
            )
        future = self._thread.submit(self._run, task)
        self._jobs[future] = job_id
        return future

    def done(self) -> set[str]:
        """Return the jobs whose images are done since the last call."""
        done = [future for future in self._jobs if future.done()]
        return {self._jobs.pop(future) for future in done}

    def close(self) -> None:
        """End the process, if one runs, and start no other."""
        with self._lock:
            self._is_closed = True
            if self._process is not None:
                self._process.kill()
        self._thread.shutdown(cancel_futures=True)

    def _run(self, task: DenoisingTask) -> Denoised:
        question = io.BytesIO()
        child.write(question, task.arrays())
        first_s, pixel_s = _DEADLINE_S
        with self._lock:
            if self._is_closed:
                raise DenoisingFailed("the monitor stops")
            process = self._process = subprocess.Popen(
                [sys.executable, "-m", child.__name__],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env=plain_environment(),
                preexec_fn=die_with_parent(signal.SIGKILL),
                start_new_session=True,
            )
        try:
            limit_s = first_s + pixel_s * task.image[..., 0].size
            answer, words = process.communicate(question.getvalue(), limit_s)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            raise DenoisingFailed(f"it took more than {limit_s:.0f} s") from None
        finally:
            self._process = None
        if process.returncode:
            said = words.decode(errors="replace").strip().rpartition("\n")[2]
            raise DenoisingFailed(said or f"its process ended with status {process.returncode}")
        return Denoised.restored(child.read(io.BytesIO(answer)))
