"""Scenes where they lie: a bundle that names files of scene roots instead of holding them.

Such a bundle is a zip. It holds the scene's XML files, and a list of all other files that these
name: each with its place, ``ROOT/PATH``, its size and its SHA-256. So the SHA-256 of the bundle
stands for every byte of the scene. In the XML an absolute path is written ``{ROOT}/PATH``. A worker
puts links beside the unpacked XML, to the files as it sees them, and writes its own paths.
"""

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final
from xml.sax.saxutils import escape

from plateau.farm.bundle.hashes import Content
from plateau.farm.bundle.limits import BundleError
from plateau.farm.model.scene_roots import SceneRoot, is_windows

#: The list in such a bundle.
LIST_NAME: Final = "plateau-placed.json"
MOST_LIST_BYTES: Final = 2**24

_VERSION: Final = 1
_SHA256: Final = re.compile(r"[0-9a-f]{64}")
_QUOTES: Final = {'"': "&quot;", "'": "&apos;"}


@dataclass(frozen=True)
class Placed:
    """The list of a bundle."""

    entry: str  #: the scene's XML in the bundle
    #: the files that it names, by their names in the bundle, ``ROOT/PATH``
    files: Mapping[str, Content]

    @property
    def roots(self) -> tuple[str, ...]:
        """The roots in which a worker needs to have files, and the scene's own."""
        return tuple(sorted({name.partition("/")[0] for name in (self.entry, *self.files)}))

    def to_json(self) -> bytes:
        """The list as text, the same for the same files."""
        files = {name: asdict(one) for name, one in sorted(self.files.items())}
        document = {"placed": _VERSION, "entry": self.entry, "files": files}
        return json.dumps(document, indent=1, ensure_ascii=False).encode()

    @classmethod
    def from_json(cls, text: bytes) -> "Placed":
        """Read a list; the names in it are not checked.

        Raises
        ------
        BundleError
            It is no such list.
        """
        try:
            document: Any = json.loads(text)
            if document["placed"] != _VERSION:
                raise ValueError(f"its version is not {_VERSION}")
            return cls(
                str(document["entry"]),
                {str(name): _content(**one) for name, one in document["files"].items()},
            )
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise BundleError(
                "not-a-scene", "it is no list of files in scene roots", file=LIST_NAME
            ) from error


def _content(*, bytes: int, sha256: str) -> Content:  # noqa: A002 - the field's name
    if not (type(bytes) is int and bytes >= 0 and _SHA256.fullmatch(sha256)):
        raise ValueError("neither a size nor a SHA-256")
    return Content(bytes, sha256)


def with_names(xml: bytes, roots: Iterable[SceneRoot]) -> bytes:
    """Return an XML file with ``{ROOT}`` in place of the roots' paths, of any platform.

    Only what begins an attribute's value counts.
    """
    for root in roots:
        for prefix in root.prefixes:
            xml = _renamed(xml, prefix, f"{{{root.name}}}")
    return xml


def with_paths(xml: bytes, roots: Iterable[str], folder: Path) -> bytes:
    """Return an XML file with a folder's path and the name of the root in place of ``{ROOT}``."""
    for name in roots:
        xml = _replaced(xml, f"{{{name}}}", escape(str(folder / name), _QUOTES))
    return xml


def path_for(value: str, roots: Iterable[str], folder: Path) -> str:
    """Return a job parameter, likewise."""
    found = in_root(value, roots)
    return value if found is None else f"{folder / found[0]}{found[1]}"


def in_root(value: str, roots: Iterable[str]) -> tuple[str, str] | None:
    """Return the root of ``{ROOT}`` or ``{ROOT}/PATH``, and the rest with its slash; or None."""
    for name in roots:
        if value == f"{{{name}}}" or value.startswith(f"{{{name}}}/"):
            return name, value[len(name) + 2 :]
    return None


def _value_that_begins(prefix: str, flags: str = "") -> bytes:
    return rf"{flags}(=\s*[\"']){re.escape(prefix)}(?=[/\\\"'])".encode()


def _replaced(xml: bytes, prefix: str, by: str) -> bytes:
    return re.sub(_value_that_begins(prefix), lambda one: one[1] + by.encode(), xml)


def _renamed(xml: bytes, prefix: str, name: str) -> bytes:
    if not is_windows(prefix):
        return _replaced(xml, prefix, name)
    for spelling in {prefix, prefix.replace("/", "\\"), prefix.replace("\\", "/")}:
        value = _value_that_begins(spelling, "(?i)") + rb"([^\"'<]*)"
        xml = re.sub(value, lambda one: one[1] + name.encode() + one[2].replace(b"\\", b"/"), xml)
    return xml
