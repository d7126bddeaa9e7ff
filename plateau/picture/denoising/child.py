"""The process that denoises: a task is one question, and the denoised image its answer."""

from hashlib import sha256
from typing import IO

from plateau.farm.process.child import read_part, serve
from plateau.metric import Image, blend_error, blended
from plateau.picture.denoised import Denoised, DenoisingTask, packed, unpacked
from plateau.picture.denoising import oidn


class Denoiser:
    """Denoises one task after the other; the halves of a draft are known when its image comes."""

    def __init__(self) -> None:
        self._draft: dict[bytes, Image] = {}  # what became of the last task's images, if it was one

    def denoised(self, task: DenoisingTask) -> Denoised:
        """Return the image of the task denoised, and its error."""
        known = {} if task.is_draft else self._draft
        self._draft = {}
        run, words = oidn.denoiser(task.guides, task.view, task.gain)
        about = sha256(repr((task.view, task.gain)).encode())
        for guide in task.guides:
            about.update(guide.tobytes())

        def denoise(image: Image) -> Image:
            name = about.copy()
            name.update(image.tobytes())
            key = name.digest()
            found = known[key] if key in known else run(image)
            if task.is_draft:
                self._draft[key] = found
            return found

        blend, error = blended(
            task.image, task.halves, denoise, task.view, see=task.seen, is_draft=task.is_draft
        )
        others = task.others and blend_error(
            blend, task.image, task.others, denoise, task.view, see=task.seen
        )
        words += ", of halves" if task.is_draft else ""
        return Denoised(blend, error, words, others, task.is_draft)


def main() -> None:
    """Denoise the images on the standard input."""
    denoiser = Denoiser()

    def answer(stream: IO[bytes]) -> memoryview:
        task = DenoisingTask.restored(unpacked(read_part(stream)))
        return packed(denoiser.denoised(task).arrays())

    serve(answer)


if __name__ == "__main__":
    main()
