"""The one place where extensions are named: packages that the rest of Plateau does not know.

Of an extension the rest asks for a module by its name, and imports it only then:

``cli``
    adds commands to `plateau.cli.app.app` as it is imported
``routes``
    ``mount(app, client)`` adds routes to the API, which has its parts by then
``ledger``
    ``orphans(client, store)`` are blobs that a sweep may remove
"""

from collections.abc import Iterator
from importlib import import_module
from types import ModuleType
from typing import Final

EXTENSIONS: Final = ("plateau.study",)


def extensions(module: str) -> Iterator[ModuleType]:
    """The module of this name of each extension."""
    for name in EXTENSIONS:
        yield import_module(f"{name}.{module}")
