"""The command line: options and help of each command; `plateau.commands` does the work.

No heavy module is imported here, so --help and a mistyped option answer at once.
"""

import atexit
import gc
from typing import Final

# Help lists the commands in this order.
# isort: off
from plateau.cli import serving, scaling, jobs, steering, continuing, batches  # noqa: F401
from plateau.cli import results, images, keys  # noqa: F401

# isort: on
from plateau.cli.app import app
from plateau.cli.bash_completion import completing_in_bash, with_whole_words
from plateau.extensions import extensions

__all__ = ["app", "main"]

list(extensions("cli"))  # each adds its commands


#: Python's garbage collector runs after this many more allocations than deallocations. Imports
#: allocate much and free little: with the default of 700, the collector takes a tenth of a start.
_OBJECTS: Final = 10_000


def main() -> None:
    """Run the command line."""
    gc.set_threshold(_OBJECTS)
    atexit.register(gc.freeze)  # no last collection: the process frees everything
    if completing_in_bash("_PLATEAU_COMPLETE"):
        with_whole_words(lambda: app(prog_name="plateau"))
    else:
        app(prog_name="plateau")
