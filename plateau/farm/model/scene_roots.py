"""Scene roots: folders of scenes that the API and the workers see, each under a name of its own.

A root has one name everywhere, and on each machine the path under which that machine sees it. A
file in it is called ``{NAME}/PATH``.
"""

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

#: A worker that has a root has the tag with this in front of the root's name.
_TAG: Final = "root."

_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,30}")
_NAMED: Final = re.compile(r"\{([^{}/\\]*)\}(?:[/\\](.*))?", re.DOTALL)
_WINDOWS: Final = re.compile(r"[A-Za-z]:[/\\]|\\\\")


@dataclass(frozen=True)
class SceneRoot:
    """A scene root, as one machine knows it."""

    name: str
    path: Path  #: absolute, on this machine
    #: paths under which other platforms know it, such as ``/Volumes/assets`` or ``Z:/assets``
    elsewhere: tuple[str, ...] = ()

    @property
    def prefixes(self) -> tuple[str, ...]:
        """What an absolute path in the root begins with, on any platform; without a last slash."""
        return (str(self.path), *self.elsewhere)

    def inside(self, path: str) -> str | None:
        """The rest of an absolute path of any platform that leads into this root, with ``/``."""
        for prefix in self.prefixes:
            if is_windows(prefix):
                here, given = prefix.replace("\\", "/"), path.replace("\\", "/")
                is_inside = given.casefold().startswith(f"{here}/".casefold())
            else:
                here, given = prefix, path
                is_inside = given.startswith(f"{here}/")
            if is_inside:
                return given[len(here) + 1 :]
        return None


def at_home(path: str | os.PathLike[str]) -> Path:
    """A path, with the home folder in place of a ``~`` as a shell puts it."""
    return Path(os.path.expanduser(path))  # noqa: PTH111 - the other one fails without that folder


def is_windows(path: str) -> bool:
    """Whether an absolute path is one of Windows, with a drive or a server."""
    return _WINDOWS.match(path) is not None


def root_tag(name: str) -> str:
    """The tag of workers that have this root."""
    return f"{_TAG}{name}"


def is_root_tag(tag: str) -> bool:
    """Whether a tag is that of a root."""
    return tag.startswith(_TAG)


def named_path(text: str, roots: Iterable[SceneRoot]) -> tuple[str, str] | None:
    """The root's name, and the path in it, of ``{NAME}/PATH`` or of an absolute path in a root.

    None for any other text, also where no root has the name.

    Examples
    --------
    >>> roots = read_roots("assets=/mnt/assets|Z:/assets")
    >>> named_path("{assets}/walk/scene.xml", roots)
    ('assets', 'walk/scene.xml')
    >>> named_path("z:/assets/walk/scene.xml", roots)
    ('assets', 'walk/scene.xml')
    >>> named_path("/etc/passwd", roots)
    """
    known = {root.name: root for root in roots}
    named = _NAMED.fullmatch(text)
    if named is not None:
        return (named[1], (named[2] or "").replace("\\", "/")) if named[1] in known else None
    for name, root in known.items():
        if (rest := root.inside(text)) is not None:
            return name, rest
    return None


def read_roots(text: str) -> tuple[SceneRoot, ...]:
    """The roots of a setting: ``NAME=PATH|PATH,NAME=PATH``; this machine's path comes first.

    Raises
    ------
    ValueError
        An entry is wrong; the message says how.

    Examples
    --------
    >>> read_roots("assets=/mnt/assets|/Volumes/assets")[0].elsewhere
    ('/Volumes/assets',)
    """
    found: dict[str, SceneRoot] = {}
    for entry in filter(None, map(str.strip, text.split(","))):
        name, _, paths = entry.partition("=")
        here, *elsewhere = (path.strip().rstrip("/\\") for path in paths.split("|"))
        if not _NAME.fullmatch(name) or name in found:
            raise ValueError(
                f"{entry!r} must be NAME=PATH with a new name of up to 31 letters, digits, _ and -"
            )
        here = str(at_home(here))
        if not here.startswith("/"):
            raise ValueError(f"the path of the root {name} must be absolute, and not / itself")
        for other in elsewhere:
            if not (other.startswith("/") or is_windows(other)):
                raise ValueError(f"{other!r}, a path of the root {name}, must be absolute")
        found[name] = SceneRoot(name, Path(here), tuple(elsewhere))
    return tuple(found.values())
