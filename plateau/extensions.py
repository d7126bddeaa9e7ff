"""What installed distributions offer by entry points: rules, renderers and extensions.

The entry points are read once in a process, when the first of them is needed; that takes some
milliseconds.

An extension is a package that no other module of Plateau names. It has modules of these names, each
of which is imported when it is needed:

``cli``
    adds commands to `plateau.cli.app.app` when it is imported
``routes``
    ``mount(app, client)`` adds routes to the API, which already has its own
``ledger``
    ``orphans(client, store)`` returns the blobs that a sweep may remove
"""

from collections.abc import Iterator
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from types import ModuleType
from typing import Any, Final

EXTENSIONS: Final = ("plateau.study",)


@cache
def _installed() -> Any:
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
    """Each extension's module of this name."""
    for name in EXTENSIONS:
        yield import_module(f"{name}.{module}")
