"""An installation of Plateau that lacks an extension."""

from pathlib import Path

_MISSING = """
import sys
from importlib.metadata import Distribution

modules = {modules!r}
sys.modules.update(dict.fromkeys(modules))
every = Distribution.entry_points.fget
Distribution.entry_points = property(
    lambda self: [one for one in every(self) if not one.value.startswith(tuple(modules))]
)
"""


def without(folder: Path, *modules: str) -> str:
    """Return a PYTHONPATH with which processes have none of these modules, nor their entry points.

    Parameters
    ----------
    folder
        Empty; what hides them is written there.
    """
    content = _MISSING.format(modules=modules)
    (folder / "sitecustomize.py").write_text(content, encoding="utf-8")
    return str(folder)
