"""Blender's Python module, without what it prints, and with its errors as this farm has them."""

from __future__ import annotations

import ctypes
import os
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

from plateau.worker.renderers.contract import SceneError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Any

_STDOUT = 1


@contextmanager
def blender() -> Iterator[None]:
    """Turn what Blender raises into `SceneError`, and drop its running account on stdout.

    Raises
    ------
    SceneError
        With Blender's words.
    """
    try:
        with _quiet():
            yield
    except RuntimeError as error:
        words = " ".join(str(error).removeprefix("Error:").split())
        raise SceneError(f"Blender: {words}") from error


@contextmanager
def _quiet() -> Iterator[None]:
    sys.stdout.flush()
    kept, nowhere = os.dup(_STDOUT), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, _STDOUT)
    try:
        yield
    finally:
        ctypes.CDLL(None).fflush(None)  # what C has kept back goes the same way
        os.dup2(kept, _STDOUT)
        os.close(kept)
        os.close(nowhere)


def _imported() -> Any:
    with _quiet():
        import bpy
    return bpy


bpy = _imported()
