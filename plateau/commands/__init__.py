"""The command line: each command is a module, with its options, its work and its words.

Help and a mistyped option answer at once: what takes time to import, commands import when they run.
"""

import atexit
import gc
import sys
from typing import Final

# Help lists the commands in this order.
# isort: off
from plateau.commands import render, dataset, serve, doctor, submit, watch, listing, show  # noqa: F401
from plateau.commands import fetch, steer, farm, diff, judge  # noqa: F401
from plateau.commands import keys, sweep, redis_acl  # noqa: F401

# isort: on
from plateau.commands.app import app
from plateau.extensions import extensions
from plateau.streams import standard_streams

__all__ = ["app", "main", "meet_extensions"]


#: Python's garbage collector runs after this many more allocations than deallocations. Imports
#: allocate much and free little: with the default of 700, the collector takes a tenth of a start.
_OBJECTS: Final = 10_000


def meet_extensions(asked: str = "") -> None:
    """Have extensions add their commands, unless a command of Plateau's own is asked for.

    To find them takes some milliseconds.
    """
    groups = {one.name for one in app.registered_groups}
    commands = {
        one.name or one.callback.__name__.replace("_", "-")
        for one in app.registered_commands
        if one.callback
    }
    if asked not in groups | commands:
        list(extensions("commands"))  # each adds its own when it is imported


def main() -> None:
    """Run the command line."""
    with standard_streams():
        _main()


def _main() -> None:
    gc.set_threshold(_OBJECTS)
    atexit.register(gc.freeze)  # no last collection: the process frees everything
    meet_extensions("".join(sys.argv[1:2]))
    app(prog_name="plateau")
