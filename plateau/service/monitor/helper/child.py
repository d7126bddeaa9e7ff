"""A helper's side: it answers one question after the other, until its input ends."""

import os
from collections.abc import Callable
from typing import IO, Final

from plateau.service.monitor.helper.parts import write_part

#: Below the monitor, as a worker's renderer is.
_NICENESS: Final = 10


def serve(answer: Callable[[IO[bytes]], bytes | memoryview]) -> None:
    """Answer questions on the standard input, which `answer` reads, each whole.

    An exception ends the process; the monitor has its last line.
    """
    os.nice(_NICENESS)
    with open(0, "rb") as questions, open(1, "wb") as answers:
        while questions.peek(1):
            write_part(answers, answer(questions))
            answers.flush()
