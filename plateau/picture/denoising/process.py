"""The monitor's side of the process that denoises, one image after the other."""

from concurrent.futures import Future, ThreadPoolExecutor
from typing import Final

from plateau.farm.process.child import write_part
from plateau.farm.process.helper import HelperProcess
from plateau.farm.process.memory import memory_bytes
from plateau.picture.denoised import Denoised, DenoisingTask, packed, unpacked
from plateau.picture.denoising import child

#: Seconds that an image may take for each pixel: some twenty times what two cores need.
PIXEL_S: Final = 2e-4
#: And those that it may take beside.
_START_S: Final = 60.0
#: Bytes of memory that the process takes, and those for each pixel.
_MEMORY: Final = (7e7, 570.0)
#: Those of the network for each pixel, and where it begins to denoise in tiles.
_NETWORK: Final = (610.0, 2e9)


class TooLarge(Exception):
    """This machine has not the memory for the image."""


class Denoising:
    """Denoises images one after the other, in a process of its own."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="denoising")
        self._jobs: dict[Future[Denoised], str] = {}  # of the images that are not noted as done
        self._process = HelperProcess(child.__name__)

    @property
    def is_busy(self) -> bool:
        """Whether an image is being denoised, or is done and not yet noted."""
        return bool(self._jobs)

    def start(self, job_id: str, task: DenoisingTask) -> "Future[Denoised]":
        """Return the future image of a job; it fails with `NoAnswer`.

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
                f"monitor may have {here / 1e9:.1f} GB"
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
        self._process.close()
        self._thread.shutdown(cancel_futures=True)

    def _run(self, task: DenoisingTask) -> Denoised:
        limit_s = _START_S + PIXEL_S * task.image[..., 0].size
        answer = self._process.ask(
            lambda stream: write_part(stream, packed(task.arrays())), limit_s
        )
        return Denoised.restored(unpacked(answer))
