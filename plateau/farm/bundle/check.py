"""Checks uploaded scenes without a renderer, and unpacks them.

An upload is a file of one of the formats of `plateau.farm.bundle.formats`, such as a Mitsuba XML,
or a zip of one with its meshes and textures. Nothing in it is trusted. The API checks it before it
stores it, and a worker checks the archive again as it unpacks it. Neither runs a renderer.

The check refuses what reaches beyond the bundle (paths, links, libraries that Mitsuba would load),
what costs too much (bombs, include cycles, huge films), unknown plugins where the limits name the
known ones, and meshes and images that Mitsuba cannot read. Only a renderer, in a child process,
judges the values, or reads a format that it alone knows.
"""

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import IO, BinaryIO

from plateau.farm.bundle.archive import Archive
from plateau.farm.bundle.entry import find_entry
from plateau.farm.bundle.formats import Checked, SceneFormat, format_named, formats
from plateau.farm.bundle.limits import BundleError, BundleLimits
from plateau.farm.bundle.magic import BEGINNING_BYTES, what_it_is
from plateau.farm.bundle.tree import Bundle, Parts

_ZIP_MAGIC = b"PK"
#: Space, and the bytes of a byte order mark or of half an ASCII character in UTF-16.
_NOT_TEXT = b" \t\r\n\0\xef\xbb\xbf\xff\xfe"
_COPY_BYTES = 2**20
_DEFAULT_LIMITS = BundleLimits()


@dataclass(frozen=True, kw_only=True)
class SceneSummary(Checked):
    """What a check learned of an upload."""

    #: of a single file, as its format calls it; "zip"
    kind: str
    renderer: str
    #: the name of the scene's own file in the bundle
    entry: str
    #: number of files in the bundle, and their size in bytes when unpacked; with those that it
    #: names in scene roots
    files: int
    bytes_unpacked: int
    #: the scene roots in which it has files
    roots: tuple[str, ...] = ()


def inspect_bundle(
    source: Path | BinaryIO,
    *,
    parameters: Mapping[str, str] | None = None,
    sensor: int = 0,
    limits: BundleLimits = _DEFAULT_LIMITS,
) -> SceneSummary:
    """Return the contents of an upload after every check that needs no Mitsuba.

    Parameters
    ----------
    source : Path or seekable binary file
        The upload. A file is read from its start and left open.
    parameters : mapping of str to str, optional
        The job's values for the scene's `$parameters`.
    sensor : int
        Index of the sensor whose image is wanted.
    limits : BundleLimits
        What is allowed.

    Raises
    ------
    BundleError
        The upload is refused; `CODES` has the codes.

    Notes
    -----
    Sizes are those that the archive declares; `unpack_bundle` checks them.
    """
    return next(inspect_each(source, [(parameters or {}, sensor)], limits))


def inspect_each(
    source: Path | BinaryIO,
    asked: Iterable[tuple[Mapping[str, str], int]],
    limits: BundleLimits = _DEFAULT_LIMITS,
) -> Iterator[SceneSummary]:
    """Yield `inspect_bundle`'s summary for each of these parameters and sensors."""
    with _opened(source) as stream:
        bundle = _bundle(stream, limits)
        entry = _entry(bundle, limits)
        scene_format = format_named(entry) if isinstance(bundle, Archive) else bundle.format
        for parameters, sensor in asked:
            found = scene_format.check(bundle, entry, parameters, sensor, limits)
            yield SceneSummary(
                kind="zip" if isinstance(bundle, Archive) else bundle.format.kind,
                renderer=scene_format.renderer,
                entry=bundle.label(entry),
                files=len(bundle.files),
                bytes_unpacked=sum(bundle.files.values()),
                roots=bundle.placed.roots if bundle.placed else (),
                **vars(found),
            )


def unpack_bundle(
    source: Path | BinaryIO, folder: Path, limits: BundleLimits = _DEFAULT_LIMITS
) -> str:
    """Unpack an upload, and return the name of the scene's own file below `folder`.

    The archive's directory is checked as by `inspect_bundle`, and the files' sizes against it. The
    scene itself is not read: call `inspect_bundle` for that.

    Parameters
    ----------
    source : Path or seekable binary file
        The upload.
    folder : Path
        Empty, or to be made. After an error it holds part of the bundle.
    limits : BundleLimits
        What is allowed.

    Raises
    ------
    BundleError
        The upload is refused; `CODES` has the codes.
    FileExistsError
        The folder is not empty.
    """
    folder.mkdir(mode=0o755, parents=True, exist_ok=True)
    if any(folder.iterdir()):
        raise FileExistsError(f"{folder} is not empty")
    with _opened(source) as stream:
        bundle = _bundle(stream, limits)
        entry = _entry(bundle, limits)
        for path in sorted(bundle.folders - {()}):
            made = folder.joinpath(*path)
            made.mkdir()
            made.chmod(0o755)
        for path, declared_bytes in sorted(bundle.held.items()):
            with bundle.open(path) as packed:
                written_bytes = _write(packed, folder.joinpath(*path), declared_bytes)
            if written_bytes != declared_bytes:
                raise BundleError(
                    "zip-malformed",
                    f"the archive says that it has {declared_bytes} bytes, which is not so",
                    file=bundle.label(path),
                )
    return bundle.label(entry)


class _LoneFile(Bundle):
    """A bundle of one file."""

    remedy = (
        "is not in the upload, which is a single XML file; send a zip of the scene and its files "
        "(`plateau render` and `plateau submit` make one)"
    )

    def __init__(self, stream: BinaryIO, size: int, scene_format: SceneFormat) -> None:
        super().__init__()
        self._stream = stream
        self.format = scene_format
        self.files[(scene_format.entry,)] = size

    @contextmanager
    def open(self, path: Parts) -> Iterator[IO[bytes]]:  # noqa: ARG002 - there is only one
        self._stream.seek(0)
        yield self._stream


def _bundle(stream: BinaryIO, limits: BundleLimits) -> Archive | _LoneFile:
    """Return the upload's files and folders, its size and its directory checked."""
    size = stream.seek(0, os.SEEK_END)
    stream.seek(0)
    if size == 0:
        raise BundleError("empty", "the upload is empty; send a scene, or a zip of one")
    if size > limits.max_bytes:
        raise BundleError(
            "too-large", f"the upload has {size} bytes; {limits.max_bytes} are allowed"
        )
    scene_format = format_of(stream)
    if scene_format is None:
        return Archive(stream, size, limits)
    return _LoneFile(stream, size, scene_format)


def format_of(stream: IO[bytes], file: str | None = None) -> SceneFormat | None:
    """Return the format of a file, open at its start, by its first characters; None for a zip.

    Raises
    ------
    BundleError
        The file has none of the formats, or is damaged; the message names `file` where given.
    """
    beginning = stream.read(BEGINNING_BYTES)
    if beginning.startswith(_ZIP_MAGIC):
        return None
    text = beginning.translate(None, _NOT_TEXT)
    what = what_it_is(beginning)
    if what is None or not what.startswith("a web page"):
        for one in formats():
            if text.startswith(one.begins):
                return one
    raise not_a_scene(what, file)


def not_a_scene(what: str | None, file: str | None = None) -> BundleError:
    """The error for a file that is something else, in words; None for what nobody knows."""
    known = ", ".join(one.called for one in formats())
    return BundleError(
        "not-a-scene",
        f"it is {what or 'of no known kind, or damaged'} (a scene is {known}, or a zip of one with "
        "its files)",
        file=file,
    )


def _entry(bundle: Archive | _LoneFile, limits: BundleLimits) -> Parts:
    return find_entry(bundle, limits) if isinstance(bundle, Archive) else (bundle.format.entry,)


def _write(packed: IO[bytes], path: Path, declared_bytes: int) -> int:
    """Return how many bytes were written to a new file: at most one more than declared."""
    written_bytes = 0
    # Exclusive and never through a link: a file that is already there is not this bundle's.
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o644)
    with os.fdopen(handle, "wb") as file:
        os.fchmod(file.fileno(), 0o644)
        while chunk := packed.read(min(_COPY_BYTES, declared_bytes - written_bytes + 1)):
            written_bytes += file.write(chunk)
            if written_bytes > declared_bytes:
                break
    return written_bytes


def _opened(source: Path | BinaryIO) -> AbstractContextManager[BinaryIO]:
    return source.open("rb") if isinstance(source, Path) else nullcontext(source)
