"""Makes the bundle of a scene that lies in a scene root: its XML, and a list of its files.

The scene is found and read as one that is uploaded, within the same limits, and nothing outside of
the roots is opened or looked at: no path with `..` in its name, none of another folder, and no link
that leads out of its root.
"""

import zipfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, BinaryIO

from plateau.farm.bundle.archive import zip_entry
from plateau.farm.bundle.check import format_of
from plateau.farm.bundle.formats import MITSUBA_XML
from plateau.farm.bundle.hashes import Content, FileHashes
from plateau.farm.bundle.limits import BundleError, BundleLimits, shown
from plateau.farm.bundle.placed import LIST_NAME, Placed, with_names
from plateau.farm.bundle.references import Reference
from plateau.farm.bundle.tree import EntryKind, EscapeError, Parts, leaves_upwards, parts_below
from plateau.farm.bundle.walk import read_scene
from plateau.farm.model.scene_roots import SceneRoot, named_path


class RootsTree:
    """The files of scene roots as a tree, in which each root is a folder at the top."""

    remedy = "does not exist in the farm's scene roots"

    def __init__(self, roots: Iterable[SceneRoot]) -> None:
        self._roots = {root.name: root for root in roots}
        names = ", ".join(f"{{{name}}}" for name in self._roots) or "there are none"
        self.outside = f"leads out of the farm's scene roots ({names})"

    def absolute(self, reference: str) -> Parts | None:
        """Return where ``{ROOT}/PATH`` leads, or an absolute path in a root, of any platform."""
        found = named_path(reference, self._roots.values())
        return None if found is None else parts_below((found[0],), found[1])

    def kind(self, path: Parts) -> EntryKind | None:
        """Return what lies at a path; raises as `path` does."""
        here = self.path(path)
        if here is None:
            return None
        return "file" if here.is_file() else "folder" if here.is_dir() else None

    def path(self, path: Parts) -> Path | None:
        """Return the path on this machine, without links; None where there is nothing.

        Raises
        ------
        EscapeError
            It is above the roots, or a link leads out of one.
        """
        if not path:
            raise EscapeError
        root = self._roots.get(path[0])
        if root is None:
            return None
        try:
            top = root.path.resolve(strict=True)
            here = root.path.joinpath(*path[1:]).resolve(strict=True)
        except (OSError, RuntimeError, ValueError):  # nothing, a circle of links, a null byte
            return None
        if not here.is_relative_to(top):
            raise EscapeError
        return here

    def names(self, folder: Parts) -> Iterable[str]:
        """Return the names of what is in a folder."""
        here = self.path(folder) if folder else None
        return self._roots if here is None else [one.name for one in here.iterdir()]

    def is_link(self, folder: Parts) -> bool:
        """Whether the last component of a path is a link."""
        return len(folder) > 1 and self._roots[folder[0]].path.joinpath(*folder[1:]).is_symlink()

    def label(self, path: Parts) -> str:
        """Return the path as people should read it."""
        return "/".join((f"{{{path[0]}}}", *path[1:])) if path else ""

    @contextmanager
    def open(self, path: Parts) -> Iterator[IO[bytes]]:
        """Open a file for reading."""
        try:
            here = self.path(path)
            if here is None or not here.is_file():
                raise BundleError("missing-file", self.remedy, file=self.label(path))
            with here.open("rb") as stream:
                yield stream
        except EscapeError:
            raise BundleError("path-escape", self.outside, file=self.label(path)) from None


@dataclass(frozen=True)
class Found:
    """The files of a scene in its roots."""

    entry: Parts
    documents: tuple[Parts, ...]  #: the XML
    others: tuple[Parts, ...]
    folders: tuple[Parts, ...]  #: that a reference passes through or reads


def find_placed(
    name: str,
    roots: Iterable[SceneRoot],
    asked: Iterable[Mapping[str, str]],
    limits: BundleLimits,
) -> Found:
    """Find the files of a scene that lies in a scene root.

    Parameters
    ----------
    name
        The scene's XML, or a folder with a ``scene.xml``: ``{ROOT}/PATH``, or an absolute path in a
        root, of any platform.
    roots
        The scene roots on this machine.
    asked
        Sets of the job's parameters, since these can choose files. The files of all are found.
    limits
        What is allowed.

    Raises
    ------
    BundleError
        The scene is refused; `CODES` has the codes.
    """
    tree = RootsTree(roots)
    entry = _entry(tree, name)
    references: dict[Reference, None] = {}
    for values in dict.fromkeys(tuple(sorted(one.items())) for one in asked):
        references |= dict.fromkeys(read_scene(tree, entry, dict(values), limits).references)
    for reference in references:
        if leaves_upwards(reference.text) and any(map(tree.is_link, reference.visited)):
            raise BundleError(
                "unpackable-path",
                f"{shown(reference.text)} goes up from a folder that is a link; name the file by a "
                "path without the link",
                file=reference.file,
                line=reference.line,
            )
    documents = {entry} | {one.path for one in references if one.role == "include"}
    others = {one.path for one in references if one.role == "file"} - documents
    if len(others) > limits.max_entries:
        raise BundleError(
            "too-many-entries",
            f"the scene names {len(others)} files; {limits.max_entries} are allowed",
        )
    folders = {one.path for one in references if one.role == "folder"}
    folders.update(*(one.visited for one in references))
    implied = {path[:depth] for path in documents | others for depth in range(len(path))}
    return Found(
        entry, *(tuple(sorted(each)) for each in (documents, others, folders - implied - {()}))
    )


def write_placed(
    found: Found, roots: tuple[SceneRoot, ...], hashes: FileHashes, target: BinaryIO
) -> None:
    """Write the bundle of a scene that lies in a scene root.

    Parameters
    ----------
    found
        Its files.
    roots
        The scene roots on this machine.
    hashes
        Reads the files that are new or have changed.
    target
        Written to; the same files always give the same bytes.

    Raises
    ------
    BundleError
        A file is missing by now.
    OSError
        A file cannot be read, or changes meanwhile.
    """
    tree = RootsTree(roots)
    placed = Placed(
        "/".join(found.entry), {"/".join(one): _content(tree, one, hashes) for one in found.others}
    )
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for folder in found.folders:
            archive.writestr(zip_entry("/".join(folder) + "/"), b"")
        for document in found.documents:
            with tree.open(document) as stream:
                text = with_names(stream.read(), roots)
            archive.writestr(zip_entry("/".join(document)), text, zipfile.ZIP_DEFLATED)
        archive.writestr(zip_entry(LIST_NAME), placed.to_json(), zipfile.ZIP_DEFLATED)
    target.flush()


def _entry(tree: RootsTree, name: str) -> Parts:
    """The scene's XML."""
    try:
        entry = tree.absolute(name)
        if entry is None:
            raise EscapeError
        kind = tree.kind(entry)
    except EscapeError:
        raise BundleError("path-escape", f"{shown(name)} {tree.outside}") from None
    if kind == "folder":
        entry = (*entry, MITSUBA_XML.entry)
        kind = tree.kind(entry)
    if kind != "file":
        raise BundleError("missing-file", f"{shown(name)} {tree.remedy}")
    with tree.open(entry) as stream:
        if format_of(stream, tree.label(entry)) is not MITSUBA_XML:
            raise BundleError(
                "not-a-scene",
                "a scene in a scene root is a Mitsuba XML; send any other as a file",
                file=tree.label(entry),
            )
    return entry


def _content(tree: RootsTree, path: Parts, hashes: FileHashes) -> Content:
    """A file's content, read only where it is new."""
    try:
        here = tree.path(path)
    except EscapeError:
        here = None
    if here is None:  # it went after the scene was read
        raise BundleError("missing-file", tree.remedy, file=tree.label(path))
    return hashes.content(here)
