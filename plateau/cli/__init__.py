"""The command line: what each command takes and says; what it does is in `plateau.commands`.

No module of weight is imported here, so that --help and a mistyped option answer at once.
"""

import atexit
import gc
from typing import Final

from plateau.cli import serving, scaling  # isort: skip  # in the order in which help lists them
from plateau.cli import (  # isort: skip  # in the order in which help lists them
    jobs,
    continuing,
    batches,
    results,
    webhooks,
    images,
    keys,
)
from plateau.cli.app import app
from plateau.cli.bash_completion import completing_in_bash, with_whole_words
from plateau.extensions import extensions

__all__ = [
    "app",
    "batches",
    "continuing",
    "images",
    "jobs",
    "keys",
    "main",
    "results",
    "scaling",
    "serving",
    "webhooks",
]

list(extensions("cli"))  # each adds its commands


#: Python looks for cycles of garbage whenever so many more objects were made than freed; not 700
#: by default, since imports make many and free few: it is a tenth of the time that a start takes.
_OBJECTS: Final = 10_000


def main() -> None:
    """Run the command line."""
    gc.set_threshold(_OBJECTS)
    atexit.register(gc.freeze)  # all of it goes with the process: no last look for garbage
    if completing_in_bash("_PLATEAU_COMPLETE"):
        with_whole_words(lambda: app(prog_name="plateau"))
    else:
        app(prog_name="plateau")
