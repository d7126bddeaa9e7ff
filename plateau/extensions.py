"""Extensions: packages that no other module of Plateau names.

An extension has modules of these names, each of which is imported when it is needed:

``cli``
    adds commands to `plateau.cli.app.app` when it is imported
``routes``
    ``mount(app, client)`` adds routes to the API, which already has its own
``ledger``
    ``orphans(client, store)`` returns the blobs that a sweep may remove
"""

from collections.abc import Iterator
from importlib import import_module
from types import ModuleType
from typing import Final

EXTENSIONS: Final = ("plateau.study",)


def extensions(module: str) -> Iterator[ModuleType]:
    """Each extension's module of this name."""
    for name in EXTENSIONS:
        yield import_module(f"{name}.{module}")
