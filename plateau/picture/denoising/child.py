"""The process that denoises: a task is one question, and the denoised image its answer."""

from typing import IO

from plateau.farm.process.child import read_part, serve
from plateau.metric import blended
from plateau.metric.blend import blend_error
from plateau.picture.denoised import Denoised, DenoisingTask, packed, unpacked
from plateau.picture.denoising import oidn


def denoised(task: DenoisingTask) -> Denoised:
    """Return the image of the task denoised, and its error."""
    denoise, words = oidn.denoiser(task.guides, task.view, task.gain)
    blend, error = blended(task.image, task.halves, denoise, task.view, see=task.seen)
    others = task.others and blend_error(
        blend, task.image, task.others, denoise, task.view, see=task.seen
    )
    return Denoised(blend, error, words, others)


def main() -> None:
    """Denoise the images on the standard input."""

    def answer(stream: IO[bytes]) -> memoryview:
        task = DenoisingTask.restored(unpacked(read_part(stream)))
        return packed(denoised(task).arrays())

    serve(answer)


if __name__ == "__main__":
    main()
