"""The files of a bundle by their names, and the one way to follow a reference among them."""

import difflib
import unicodedata
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import IO, Literal, Protocol

from plateau.farm.bundle.limits import shown
from plateau.farm.bundle.placed import Placed

Parts = tuple[str, ...]
EntryKind = Literal["file", "folder"]

#: The kernel finds nothing by a longer name (PATH_MAX).
_MAX_PATH_CHARACTERS = 4096
#: Characters of a name in an error, and names of a folder that a search for a similar one takes.
_MAX_SHOWN = 60
_MOST_NAMES = 1000
OUT_OF_THE_BUNDLE = "leads out of the bundle; put the file into it and name it by a relative path"
_OF_WINDOWS = (
    "is a path of Windows; put the file beside the scene and name it by a relative path, with /"
)


class Tree(Protocol):
    """Files and folders by their path from a root: a bundle, or a disk that is to be packed."""

    #: where a missing file is missing and what to do, for error messages
    remedy: str
    #: what a file outside is outside of and what to do, likewise
    outside: str

    def kind(self, path: Parts) -> EntryKind | None:
        """Return what lies at a path, or None where nothing does."""

    def names(self, folder: Parts) -> Iterable[str]:
        """Return the names of what is in a folder."""

    def open(self, path: Parts) -> AbstractContextManager[IO[bytes]]:
        """Open a file for reading."""

    def label(self, path: Parts) -> str:
        """Return the path as people should read it."""

    def absolute(self, reference: str) -> Parts | None:
        """Return where an absolute reference leads, or None where those lead out of the tree."""


class Bundle:
    """The files and folders of an upload, by their paths; half of a `Tree`."""

    outside = OUT_OF_THE_BUNDLE

    def __init__(self) -> None:
        #: files with their unpacked size in bytes, as the upload declares it
        self.files: dict[Parts, int] = {}
        self.folders: set[Parts] = {()}
        #: the list of those of them that it names, and does not hold
        self.placed: Placed | None = None

    @property
    def held(self) -> dict[Parts, int]:
        """Those of `files` that the upload holds."""
        named = self.placed.files if self.placed else {}
        return {path: size for path, size in self.files.items() if self.label(path) not in named}

    def kind(self, path: Parts) -> EntryKind | None:
        """Return what lies at a path, or None where nothing does."""
        return "file" if path in self.files else "folder" if path in self.folders else None

    def names(self, folder: Parts) -> Iterable[str]:
        """Return the names of what is in a folder."""
        here = len(folder)
        return {
            path[here]
            for path in (*self.files, *self.folders)
            if len(path) > here and path[:here] == folder
        }

    def label(self, path: Parts) -> str:
        """Return the path as people should read it."""
        return "/".join(path)

    def absolute(self, reference: str) -> Parts | None:  # noqa: ARG002 - all lead out
        """Return None: no absolute reference leads into a bundle."""
        return None


@dataclass(frozen=True)
class Found:
    """Where a reference led."""

    #: the file or folder; None where there is nothing
    path: Parts | None
    kind: EntryKind | None
    #: every folder on the way, on the way of failed candidates too
    visited: frozenset[Parts]
    lookups: int


class EscapeError(Exception):
    """A reference leaves the tree; says why and what to do, where the tree's `outside` does not."""


def is_absolute(reference: str) -> bool:
    """Return whether a reference starts at a root or a drive, on any operating system."""
    return reference[:1] in ("/", "\\") or (reference[:1].isalpha() and reference[1:2] == ":")


def leaves_upwards(reference: str) -> bool:
    """Return whether a reference has a `..` component, on any operating system."""
    return ".." in reference.replace("\\", "/").split("/")


def find(tree: Tree, bases: Sequence[Parts], reference: str) -> Found:
    """Return the first file or folder that a reference names, from each base folder in turn.

    Mitsuba takes the first candidate that exists. A candidate that leaves the tree ahead of the
    first hit is therefore refused: on the machine that renders, something may lie there.

    Raises
    ------
    EscapeError
        A candidate leaves the tree.
    """
    absolute = tree.absolute(reference)
    if absolute is not None:
        return Found(absolute, tree.kind(absolute), frozenset(), lookups=1)
    if is_absolute(reference):
        raise EscapeError("" if reference.startswith("/") else _OF_WINDOWS)
    if len(reference) > _MAX_PATH_CHARACTERS:
        return Found(None, None, frozenset(), lookups=1)
    components = [part for part in reference.split("/") if part not in ("", ".")]
    visited: set[Parts] = set()
    lookups = 0
    for base in bases:
        path = _follow(tree, base, components, visited)
        lookups += 1 + len(components)
        kind = None if path is None else tree.kind(path)
        if kind is not None:
            return Found(path, kind, frozenset(visited), lookups)
    return Found(None, None, frozenset(visited), lookups)


def _follow(
    tree: Tree, base: Parts, components: Sequence[str], visited: set[Parts]
) -> Parts | None:
    """Return where one candidate leads, walking as the kernel does: `nowhere/..` is nowhere."""
    here = base
    for component in components:
        if tree.kind(here) != "folder":
            return None
        visited.add(here)
        if component == "..":
            if not here:
                raise EscapeError
            here = here[:-1]
        else:
            here = (*here, component)
    return here


def suggestion(tree: Tree, bases: Sequence[Parts], reference: str) -> str:
    """Return a phrase with what a reference that leads nowhere may mean; "" if nothing is like it.

    Mitsuba takes names as they are. Files are often named on a system that ignores case and how
    accents are composed, and takes a backslash for a slash.
    """
    for base in bases:
        here, meant = base, []
        for part in (one for one in reference.replace("\\", "/").split("/") if one):
            if part == ".." and here:
                here = here[:-1]
            elif part != ".":
                try:
                    near = _nearest(part, tree.names(here) if tree.kind(here) == "folder" else ())
                except (OSError, EscapeError):
                    near = None
                if near is None:
                    break
                here, part = (*here, near), near
            meant.append(part)
        else:
            break
    else:
        return "; write / between folders" if "\\" in reference else ""
    name = "/".join(meant)
    if unicodedata.normalize("NFC", name) == unicodedata.normalize("NFC", reference):
        return (
            f"; there is {shown(name)}, which looks the same and has other characters (Unicode "
            f"composes accents in two ways: {reference[:_MAX_SHOWN]!a} here, "
            f"{name[:_MAX_SHOWN]!a} there): rename the file"
        )
    case = " (case counts)" if name.casefold() == reference.casefold() else ""
    slash = " (with / between folders)" if "\\" in reference else case
    return f"; did you mean {shown(name)}{slash}?"


def _nearest(name: str, names: Iterable[str]) -> str | None:
    """Return the name that is this one, or else one that differs in case, accents or a typo."""
    there = {folded(one): one for one in names}
    if name in there.values():
        return name
    near = difflib.get_close_matches(folded(name), list(there)[:_MOST_NAMES], n=1, cutoff=0.8)
    return there.get(folded(name)) or (there[near[0]] if near else None)


def folded(path: str) -> str:
    """Return a path as a file system sees it that ignores case and the composition of accents.

    Unicode's canonical caseless matching (The Unicode Standard, definition D145).
    """
    return unicodedata.normalize("NFD", unicodedata.normalize("NFD", path).casefold())


def parts_below(folder: Parts, rest: str) -> Parts:
    """Return where the rest of an absolute reference leads, below a folder.

    Raises
    ------
    EscapeError
        It has a `..` component.
    """
    if leaves_upwards(rest):
        raise EscapeError
    return (*folder, *(part for part in rest.split("/") if part not in ("", ".")))


def put_first(folder: Parts, folders: tuple[Parts, ...]) -> tuple[Parts, ...]:
    """Return the folders with this one moved to the front."""
    return (folder, *(other for other in folders if other != folder))
