"""The process that denoises: one task on its standard input, one answer on its standard output."""

import io
import os
import sys
from typing import BinaryIO

import numpy as np

from plateau.metric import blend_error, blended
from plateau.service.judging.denoised import Arrays, Denoised, DenoisingTask
from plateau.service.monitor.denoising import oidn

#: Below the monitor, as a worker's renderer is.
_NICENESS = 10


def main() -> None:
    """Denoise the image on the standard input."""
    os.nice(_NICENESS)
    write(sys.stdout.buffer, denoised(DenoisingTask.restored(read(sys.stdin.buffer))).arrays())


def denoised(task: DenoisingTask) -> Denoised:
    """Return the image of the task denoised, and its error."""
    denoise, words = oidn.denoiser(task.guides, task.view, task.gain)
    blend, error = blended(
        task.image, task.halves, denoise, task.view, see=task.seen, is_draft=task.is_draft
    )
    others = task.others and blend_error(
        blend, task.image, task.others, denoise, task.view, see=task.seen
    )
    words += ", of halves" if task.is_draft else ""
    return Denoised(blend, error, words, others, task.is_draft)


def write(stream: BinaryIO, arrays: Arrays) -> None:
    """Write arrays as one ``.npz`` file."""
    np.savez(stream, allow_pickle=False, **arrays)
    stream.flush()


def read(stream: BinaryIO) -> Arrays:
    """Read what `write` wrote, to the stream's end."""
    with np.load(io.BytesIO(stream.read()), allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


if __name__ == "__main__":
    main()
