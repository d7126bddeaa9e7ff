"""The process that denoises: a task is one question, and the denoised image its answer."""

import io
from hashlib import sha256
from typing import IO

import numpy as np

from plateau.metric import Denoise, blend_error, blended
from plateau.metric.display import Image
from plateau.service.judging.denoised import Arrays, Denoised, DenoisingTask
from plateau.service.monitor.denoising import oidn
from plateau.service.monitor.helper.child import serve
from plateau.service.monitor.helper.parts import read_part


class Denoiser:
    """Denoises one task after the other.

    It keeps what became of the last one's images: a draft's halves come again with the image.
    """

    def __init__(self) -> None:
        self._last: dict[bytes, Image] = {}

    def denoised(self, task: DenoisingTask) -> Denoised:
        """Return the image of the task denoised, and its error."""
        run, words = oidn.denoiser(task.guides, task.view, task.gain)
        denoise, kept = self._remembered(run, repr((task.view, task.gain)), task.guides)
        blend, error = blended(
            task.image, task.halves, denoise, task.view, see=task.seen, is_draft=task.is_draft
        )
        others = task.others and blend_error(
            blend, task.image, task.others, denoise, task.view, see=task.seen
        )
        self._last = kept
        words += ", of halves" if task.is_draft else ""
        return Denoised(blend, error, words, others, task.is_draft)

    def _remembered(
        self, run: Denoise, settings: str, guides: tuple[Image, ...]
    ) -> tuple[Denoise, dict[bytes, Image]]:
        """Return the denoiser, which runs only for what is new, and all that it returns."""
        kept: dict[bytes, Image] = {}
        about = sha256(settings.encode())
        for guide in guides:
            about.update(guide.tobytes())

        def denoise(image: Image) -> Image:
            name = about.copy()
            name.update(image.tobytes())
            key = name.digest()
            kept[key] = self._last[key] if key in self._last else run(image)
            return kept[key]

        return denoise, kept


def packed(arrays: Arrays) -> memoryview:
    """Return arrays as one ``.npz`` file."""
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    return file.getbuffer()


def unpacked(content: bytes) -> Arrays:
    """Return what was `packed`."""
    with np.load(io.BytesIO(content), allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


def main() -> None:
    """Denoise the images on the standard input."""
    denoiser = Denoiser()

    def answer(stream: IO[bytes]) -> memoryview:
        task = DenoisingTask.restored(unpacked(read_part(stream)))
        return packed(denoiser.denoised(task).arrays())

    serve(answer)


if __name__ == "__main__":
    main()
