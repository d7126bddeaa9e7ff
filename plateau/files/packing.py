"""Packs a scene into one file for the farm: the XML and all files that it refers to.

The files are found by the same walk with which the farm checks a bundle. They keep their relative
places: the bundle starts at the folder that contains all of them, so `../textures/wood.png` still
leads from the scene to its texture. Of other formats only the renderer knows to which files a
scene refers: a folder with such a scene is packed whole.

The same scene always has the same bytes, and thus the same SHA-256, so it is stored once.
"""

import os
import shutil
import tempfile
import zipfile
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import IO, BinaryIO, cast

from plateau.farm.bundle import BundleError, BundleLimits
from plateau.farm.bundle.archive import Archive, is_too_dense, zip_entry
from plateau.farm.bundle.check import format_of
from plateau.farm.bundle.entry import find_entry
from plateau.farm.bundle.formats import (
    MITSUBA_XML,
    SceneFormat,
    format_named,
    formats,
    with_suffix,
)
from plateau.farm.bundle.references import Reference
from plateau.farm.bundle.tree import OUT_OF_THE_BUNDLE, EntryKind, Parts
from plateau.farm.bundle.walk import read_scene

_ZIP = "application/zip"
#: Files that are already compressed are not deflated.
_COMPRESSED = frozenset((".exr", ".jpg", ".jpeg", ".png", ".serialized", ".vdb"))
#: Entries of at least this many bytes are written in the 64-bit format.
_ZIP64_BYTES = 2**30
_COPY_BYTES = 2**20
_LIMITS = BundleLimits()


@dataclass(frozen=True)
class Packed:
    """A scene as one file, open at its start; a context manager that closes it."""

    file: BinaryIO
    media_type: str
    name: str  #: of the upload
    files: tuple[Path, ...]  #: the packed files

    def __enter__(self) -> "Packed":
        return self

    def __exit__(self, *error: object) -> None:
        self.file.close()


def pack(path: Path, *parameters: Mapping[str, str]) -> Packed:
    """Return a scene as one file, open for reading.

    The same files give the same bytes with the same version of zlib.

    Parameters
    ----------
    path
        A Mitsuba XML; a folder with a `scene.xml` or a scene of another format; or a zip or a
        file of another format, which are not changed.
    parameters
        Sets of values of the scene's `$parameters`, since these can choose files. The files of all
        sets are packed, as the jobs of a batch need them.

    Raises
    ------
    BundleError
        A file is missing or cannot keep its place; names it, and where the XML has it.
    """
    return _found(path, parameters).packed()


def files_of(path: Path, *parameters: Mapping[str, str]) -> tuple[Path, ...]:
    """Return the files that `pack` packs, in the order of their names; raises as `pack`."""
    return _found(path, parameters).files


@dataclass(frozen=True)
class _Found:
    """What a scene is packed of."""

    path: Path  #: of the file that is sent as it is, where there is no layout
    media_type: str
    name: str  #: of the upload
    layout: "_Layout | None" = None

    @property
    def files(self) -> tuple[Path, ...]:
        if self.layout is None:
            return (self.path,)
        return tuple(map(_Disk().path, self.layout.files))

    def packed(self) -> Packed:
        if self.layout is None:
            return Packed(self.path.open("rb"), self.media_type, self.name, self.files)
        with ExitStack() as until_it_is_good:
            bundle = cast("BinaryIO", until_it_is_good.enter_context(tempfile.TemporaryFile()))
            _write(bundle, _Disk(), self.layout)
            _check_entry(bundle, self.layout)
            until_it_is_good.pop_all()
        return Packed(bundle, self.media_type, self.name, self.files)


def _found(path: Path, parameters: Iterable[Mapping[str, str]]) -> _Found:
    if path.is_dir():
        if not (path / MITSUBA_XML.entry).is_file():
            for other in with_suffix():
                if (scene := _only_one(path, other)) is not None:
                    return _with_its_folder(scene, other)
        path = path / MITSUBA_XML.entry
        others = "".join(f", or with a {other.suffix}" for other in with_suffix())
        missing = f"there is no such file: a folder with one is a scene{others}"
    else:
        missing = "there is no such file; `scenes:box` is a scene to try"
    if not path.is_file():
        raise BundleError("missing-file", missing, file=str(path))
    with path.open("rb") as file:
        scene_format = format_of(file, str(path))
    if scene_format is not MITSUBA_XML:
        media_type = _ZIP if scene_format is None else scene_format.media_type
        return _Found(path, media_type, path.name)
    disk = _Disk()
    entry = disk.parts(path)
    references: dict[Reference, None] = {}
    # Each set of values once; the scene's own defaults if there is none.
    for values in dict.fromkeys(tuple(one.items()) for one in parameters) or [()]:
        references |= dict.fromkeys(read_scene(disk, entry, dict(values), _LIMITS).references)
    if not references:
        return _Found(path, MITSUBA_XML.media_type, f"{_name(path)}.xml")
    for reference in references:
        _check_keeps_its_place(disk, reference)
    return _Found(path, _ZIP, f"{_name(path)}.zip", _Layout.of(entry, references))


def _only_one(folder: Path, wanted: SceneFormat) -> Path | None:
    """Return the file of a format that is a folder's scene; None where there is none."""
    found = sorted(path for path in folder.iterdir() if wanted.is_named(path.parts))
    found = [path for path in found if path.name == wanted.entry] or found
    if len(found) > 1:
        raise BundleError(
            "ambiguous-scene",
            f"{len(found)} files could be the scene ({', '.join(one.name for one in found[:5])}); "
            f"name the right one {wanted.entry}",
            file=str(folder),
        )
    return found[0] if found else None


def _with_its_folder(scene: Path, of: SceneFormat) -> _Found:
    """Return a scene with all that lies in its folder but hidden files and backups."""
    disk = _Disk()
    entry = disk.parts(scene)
    top = entry[:-1]
    files = [
        disk.parts(path)
        for path in sorted(disk.path(top).rglob("*"))
        if path.is_file()
        and not (of.left_out and of.left_out.fullmatch(path.suffix))
        and not any(part.startswith(".") for part in path.relative_to(disk.path(top)).parts)
    ]
    return _Found(scene, _ZIP, f"{_name(scene)}.zip", _Layout(top, entry, tuple(files), ()))


def _name(path: Path) -> str:
    """What a scene is called: a ``scene.xml`` as its folder is."""
    named_by_folder = path.name in {one.entry for one in formats()}
    return path.resolve().parent.name if named_by_folder else path.stem


class _Disk:
    """The whole disk as a tree, from its root."""

    remedy = "does not exist; put it there, or correct its name"
    outside = OUT_OF_THE_BUNDLE

    def parts(self, path: Path) -> Parts:
        # Resolve the links of the folder, as the kernel does for `..`, but not those of the file.
        return (path.parent.resolve() / path.name).parts[1:]

    def path(self, parts: Parts) -> Path:
        return Path("/", *parts)

    def kind(self, path: Parts) -> EntryKind | None:
        here = self.path(path)
        return "file" if here.is_file() else "folder" if here.is_dir() else None

    def names(self, folder: Parts) -> list[str]:
        return [one.name for one in self.path(folder).iterdir()]

    def label(self, path: Parts) -> str:
        return str(self.path(path))

    def absolute(self, reference: str) -> Parts | None:
        return Path(reference).parts[1:] if reference.startswith("/") else None

    @contextmanager
    def open(self, path: Parts) -> Iterator[IO[bytes]]:
        with self.path(path).open("rb") as stream:
            yield stream


def _check_keeps_its_place(disk: _Disk, reference: Reference) -> None:
    """Refuse a reference that would lead to another file inside the bundle."""
    if reference.text.startswith("/"):
        problem = "is an absolute path; name it relative to the scene"
    elif ".." in reference.text.split("/") and any(
        disk.path(folder).is_symlink() for folder in reference.visited
    ):
        problem = "goes up from a folder that is a link; name the file by a path without the link"
    else:
        return
    raise BundleError(
        "unpackable-path", f"{reference.text!r} {problem}", file=reference.file, line=reference.line
    )


@dataclass(frozen=True)
class _Layout:
    """The contents of a bundle."""

    top: Parts  #: the folder at which the bundle starts
    entry: Parts
    files: tuple[Parts, ...]
    folders: tuple[Parts, ...]  #: folders without files that a reference passes through or reads

    @classmethod
    def of(cls, entry: Parts, references: Collection[Reference]) -> "_Layout":
        files = {entry} | {each.path for each in references if each.role != "folder"}
        folders = {each.path for each in references if each.role == "folder"}
        folders.update(*(each.visited for each in references))
        parents = {path[:-1] for path in files}
        top = _common(folders | parents)
        implied = {path[:depth] for path in files for depth in range(len(path))}
        bare = {folder for folder in folders - implied if len(folder) > len(top)}
        return cls(top, entry, tuple(sorted(files)), tuple(sorted(bare)))

    def inside(self, path: Parts) -> Parts:
        return path[len(self.top) :]


def _common(folders: set[Parts]) -> Parts:
    """Return the deepest folder that contains all of these."""
    first, last = min(folders), max(folders)
    pairs = zip(first, last, strict=False)
    return tuple(ours for ours, _ in takewhile(lambda pair: pair[0] == pair[1], pairs))


def _write(file: BinaryIO, disk: _Disk, layout: _Layout, even: Collection[str] = ()) -> None:
    """Write the archive: names in order, no times, no owners.

    What deflates by more than the farm takes, as an even volume does, is `even`, and stored.
    """
    compressed = {*_COMPRESSED, *(one.suffix for one in with_suffix() if one.is_compressed)}
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for folder in layout.folders:
            archive.writestr(zip_entry("/".join(layout.inside(folder)) + "/"), b"")
        for parts in layout.files:
            path = disk.path(parts)
            info = zip_entry("/".join(layout.inside(parts)))
            if path.suffix.lower() not in compressed and info.filename not in even:
                info.compress_type = zipfile.ZIP_DEFLATED
            big = path.stat().st_size >= _ZIP64_BYTES
            with path.open("rb") as source, archive.open(info, "w", force_zip64=big) as target:
                shutil.copyfileobj(source, target, _COPY_BYTES)
        found = [one.filename for one in archive.filelist if is_too_dense(one, _LIMITS)]
    if found and not even:
        file.truncate(file.seek(0))
        _write(file, disk, layout, found)


def _check_entry(file: BinaryIO, layout: _Layout) -> None:
    """Refuse a bundle in which the farm would take another file for the scene."""
    archive = Archive(file, file.seek(0, os.SEEK_END), _LIMITS)
    expected = layout.inside(layout.entry)
    found = find_entry(archive, _LIMITS)
    file.seek(0)
    if found != expected:
        raise BundleError(
            "ambiguous-scene",
            f"the farm would take {archive.label(found)} for the scene; rename the scene "
            f"{format_named(expected).entry}",
            file=archive.label(expected),
        )
