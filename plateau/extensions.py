"""What installed distributions offer by entry points: rules, renderers and extensions.

The entry points are read once in a process, when the first is needed, in some milliseconds.

An extension is a package that no other module of Plateau names, but an entry point of the group
`plateau.extensions`. It may have modules of these names, each of which is imported when it is
needed:

``commands``
    adds commands to `plateau.commands.app.app` when it is imported
``routes``
    ``mount(app, client)`` adds routes to the API, which already has its own
``ledger``
    ``orphans(client, store)`` returns the blobs that a sweep may remove
``keys``
    ``SWEPT`` and ``SERVED``: patterns of its keys in Redis, to which monitors and APIs have rights
``page``
    a folder of the web page, whose `extension.js` says what it adds
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Iterator
    from importlib.metadata import EntryPoint
    from types import ModuleType

#: The entry point group of extensions.
GROUP: Final = "plateau.extensions"


@cache
def _installed() -> Any:
    # Imported here: it takes more time than the command line has for its help.
    from importlib.metadata import entry_points

    return entry_points()


def offered(group: str) -> Iterator[tuple[EntryPoint, Any]]:
    """Yield each entry point of a group with what it names, imported.

    Raises
    ------
    ImportError
        One cannot be loaded.
    """
    kind = group.rpartition(".")[2].removesuffix("s")
    for entry in _installed().select(group=group):
        try:
            found = entry.load()
        except Exception as error:
            raise ImportError(f"the {kind} {entry.name} ({entry.value}) fails: {error}") from error
        yield entry, found


def extensions(module: str) -> Iterator[ModuleType]:
    """Each extension's module of this name, where it has one."""
    for _, extension in offered(GROUP):
        name = f"{extension.__name__}.{module}"
        if find_spec(name) is not None:
            yield import_module(name)
