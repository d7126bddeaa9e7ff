"""An untrusted zip archive: names, sizes, kinds and contents of its entries are all checked.

Python's `zipfile` reads an archive for the check and for unpacking, so that the two cannot
disagree. Only the archive's directory is read into memory, and its size is bounded first.
"""

import stat
import struct
import unicodedata
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, BinaryIO, Final, cast

from plateau.farm.bundle.limits import MIB, BundleError, BundleLimits
from plateau.farm.bundle.placed import LIST_NAME, MOST_LIST_BYTES, Placed, in_root
from plateau.farm.bundle.tree import (
    Bundle,
    Parts,
    folded,
    is_absolute,
    leaves_upwards,
    parts_below,
)

#: The longest component of a name on every common file system.
_MAX_COMPONENT_BYTES = 255
#: A directory record is 46 bytes, a name and extra fields; real ones are far smaller.
_DIRECTORY_BYTES_PER_ENTRY = 512
#: Unicode's categories of invisible characters: controls, formats, surrogates, separators.
_CONTROL_CHARACTERS = ("Cc", "Cf", "Cs", "Zl", "Zp")
_MAX_SAID = 200
_ENCRYPTED = 0x1 | 0x40 | 0x2000
_UTF8_NAME = 0x800
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
#: `zipfile`'s errors for damaged data of an entry, and for a damaged directory or header.
_BAD_DATA = (zipfile.BadZipFile, zlib.error, EOFError)
_BAD_HEADER = (
    *(*_BAD_DATA, struct.error, NotImplementedError),
    *(OSError, OverflowError, ValueError),  # offsets before the start, or past any end
)
#: Mitsuba looks for plugins/NAME.so in the scene's folders before its own (tried with 3.9.1), and
#: `dlopen` runs code: a library in a bundle could do anything.
_LIBRARIES = (".so", ".dll", ".dylib")


class Archive(Bundle):
    """The files and folders of a zip of `size` bytes whose directory has passed every check.

    Raises
    ------
    BundleError
        The archive breaks a rule.
    """

    remedy = "is not in the bundle; add it, or correct the reference"

    def __init__(self, stream: BinaryIO, size: int, limits: BundleLimits) -> None:
        super().__init__()
        self._limits = limits
        self.checked: set[Parts] = set()  #: files whose contents were found good
        bounded = _BoundedReads(stream, max(limits.max_entries * _DIRECTORY_BYTES_PER_ENTRY, MIB))
        try:
            self._zip = zipfile.ZipFile(cast("BinaryIO", bounded))
        except BundleError:
            raise
        except _BAD_HEADER as error:
            raise BundleError(
                "zip-malformed", f"the archive is damaged: {_said(error)}; pack it again"
            ) from error
        infos = self._zip.infolist()
        if not infos:
            raise BundleError("empty", "the archive holds no files; add the scene's XML")
        if len(infos) > limits.max_entries:
            raise _too_many(len(infos), limits)
        self._infos: dict[Parts, zipfile.ZipInfo] = {}
        self._seen: dict[str, str] = {}
        for info in infos:
            self._admit(info)
        self._refuse_files_as_folders()
        # Unpacking makes folders without entries, too.
        made = len(self.files) + len(self.folders) - 1
        if made > limits.max_entries:
            raise _too_many(made, limits)
        unpacked_bytes = sum(self.files.values())
        most_bytes = min(
            limits.max_unpacked_bytes,
            max(limits.total_ratio_floor_bytes, int(limits.max_ratio * size)),
        )
        if unpacked_bytes > most_bytes:
            raise BundleError(
                "zip-bomb",
                f"the archive unpacks from {size} to {unpacked_bytes} bytes; "
                f"{most_bytes} are allowed",
            )
        if sum(info.compress_size for info in infos) > size:
            raise BundleError("zip-bomb", "the archive's entries overlap; pack it again")
        self.placed = self._placed() if (LIST_NAME,) in self.files else None

    def absolute(self, reference: str) -> Parts | None:
        """Return where ``{ROOT}/PATH`` leads; None for all else."""
        found = in_root(reference, self.placed.roots) if self.placed else None
        return None if found is None else parts_below((found[0],), found[1])

    @contextmanager
    def open(self, path: Parts) -> Iterator[IO[bytes]]:
        """Open a file for reading; damaged data raises a `BundleError`."""
        name = self.label(path)
        if path not in self._infos:
            raise BundleError("missing-file", "the bundle names it, and has to hold it", file=name)
        try:
            stream = self._zip.open(self._infos[path])
        except _BAD_HEADER as error:
            raise _damaged(name, error) from error
        with stream:
            try:
                yield stream
            except _BAD_DATA as error:
                raise _damaged(name, error) from error

    def _admit(self, info: zipfile.ZipInfo) -> None:
        """Take an entry into the tree, or refuse it."""
        name = _decoded_name(info)
        is_folder = name.endswith("/")
        path = _checked_name(name.removesuffix("/"), self._limits)
        same = folded("/".join(path))
        if same in self._seen:
            other = self._seen[same]
            raise BundleError(
                "duplicate-entry",
                "the archive holds it twice"
                if other == name
                else f"its name differs from {other!r} in case alone; rename one",
                file=name,
            )
        self._seen[same] = name
        _check_type(info, name, is_folder=is_folder)
        _check_contents(info, name, self._limits)
        if is_folder:
            self.folders.add(path)
        else:
            self.files[path] = info.file_size
            self._infos[path] = info
        self.folders.update(path[:depth] for depth in range(len(path)))

    def _placed(self) -> Placed:
        """Take the files that the bundle names into the tree."""
        if self.files[(LIST_NAME,)] > MOST_LIST_BYTES:
            raise BundleError(
                "too-large", f"it has more than {MOST_LIST_BYTES} bytes", file=LIST_NAME
            )
        with self.open((LIST_NAME,)) as stream:
            placed = Placed.from_json(stream.read(MOST_LIST_BYTES))
        if len(placed.files) > self._limits.max_entries:
            raise _too_many(len(placed.files), self._limits)
        for name, content in placed.files.items():
            path = _checked_name(name, self._limits)
            if self._seen.setdefault(folded("/".join(path)), name) != name or path in self._infos:
                raise BundleError("duplicate-entry", "the bundle has the name twice", file=name)
            self.files[path] = content.bytes
            self.folders.update(path[:depth] for depth in range(len(path)))
        self._refuse_files_as_folders()
        if tuple(placed.entry.split("/")) not in self._infos:
            raise BundleError("missing-file", "the scene is not in the bundle", file=LIST_NAME)
        return placed

    def _refuse_files_as_folders(self) -> None:
        folders = {folded("/".join(path)) for path in self.folders}
        for path in self.files:
            if folded("/".join(path)) in folders:
                name = self.label(path)
                raise BundleError("duplicate-entry", "it is a file and a folder", file=name)


def _too_many(entries: int, limits: BundleLimits) -> BundleError:
    return BundleError(
        "too-many-entries",
        f"the archive has {entries} entries, folders included; {limits.max_entries} are allowed",
    )


def _damaged(name: str, error: Exception) -> BundleError:
    return BundleError("zip-malformed", f"it is damaged: {_said(error)}; pack it again", file=name)


def _said(error: Exception) -> str:
    """Return an error's text, cut: the archive's names in it may be long."""
    words = str(error)
    return words if len(words) <= _MAX_SAID else f"{words[:_MAX_SAID]}…"


class _BoundedReads:
    """A file that refuses one huge read: so `zipfile` reads a zip's directory."""

    def __init__(self, stream: BinaryIO, max_read_bytes: int) -> None:
        self._stream = stream
        self._max_read_bytes = max_read_bytes
        self.seek = stream.seek
        self.tell = stream.tell

    def seekable(self) -> bool:
        return True

    def read(self, size: int = -1) -> bytes:
        if size > self._max_read_bytes:
            raise BundleError(
                "too-many-entries",
                f"the archive's directory takes {size} bytes; "
                f"{self._max_read_bytes} are allowed, so it has too many entries",
            )
        return self._stream.read(self._max_read_bytes if size < 0 else size)


def _decoded_name(info: zipfile.ZipInfo) -> str:
    """Return an entry's name as the archive has it, before `zipfile` changes it."""
    if info.flag_bits & _UTF8_NAME:
        return info.orig_filename
    # Several archivers write UTF-8 without the flag; zipfile then reads it as code page 437.
    try:
        return info.orig_filename.encode("cp437").decode("utf-8")
    except UnicodeError:
        name = ascii(info.orig_filename[:100])
        raise BundleError(
            "entry-name", f"the name of the entry {name} is not UTF-8; rename it, or pack again"
        ) from None


def _checked_name(name: str, limits: BundleLimits) -> Parts:
    """Return the components of a name that is safe on every operating system."""
    shown = ascii(name[:100])
    if is_absolute(name) or leaves_upwards(name):
        raise BundleError("path-escape", f"the entry {shown} leaves the bundle; pack it again")
    path = tuple(name.split("/"))
    if any(component in ("", ".") for component in path):
        raise BundleError("entry-name", f"the entry {shown} has an empty component")
    if any(c in "\\:" or unicodedata.category(c) in _CONTROL_CHARACTERS for c in name):
        raise BundleError(
            "entry-name",
            f"the entry {shown} has a backslash, a colon or a control character; rename it",
        )
    if len(name.encode()) > limits.max_name_bytes or any(
        len(component.encode()) > _MAX_COMPONENT_BYTES for component in path
    ):
        raise BundleError(
            "entry-name",
            f"the name of the entry {shown}… is too long; {limits.max_name_bytes} bytes are "
            f"allowed, and {_MAX_COMPONENT_BYTES} of each folder or file",
        )
    if len(path) - 1 > limits.max_folder_depth:
        raise BundleError(
            "entry-name", f"{shown} lies under more than {limits.max_folder_depth} folders"
        )
    if path[-1].casefold().endswith(_LIBRARIES):
        raise BundleError(
            "native-code", "it is a shared library; a bundle may hold data alone", file=name
        )
    return path


def _check_type(info: zipfile.ZipInfo, name: str, *, is_folder: bool) -> None:
    """Refuse an entry that is neither a plain file nor a folder."""
    mode = info.external_attr >> 16
    expected = (0, stat.S_IFDIR) if is_folder else (0, stat.S_IFREG)
    if stat.S_IFMT(mode) not in expected:
        what = "a link" if stat.S_ISLNK(mode) else "neither a plain file nor a folder"
        raise BundleError("entry-type", f"it is {what}; put the file itself there", file=name)
    if is_folder and info.file_size:
        raise BundleError("entry-type", "it is a folder with contents", file=name)


def _check_contents(info: zipfile.ZipInfo, name: str, limits: BundleLimits) -> None:
    """Refuse an entry that is encrypted, oddly packed, or too good to be true."""
    if info.flag_bits & _ENCRYPTED:
        raise BundleError("zip-encrypted", "it is encrypted; pack without a password", file=name)
    # zipfile bounds the yield of one read of a deflated entry, and of no other method.
    if info.compress_type not in _METHODS:
        raise BundleError("zip-method", "it is not deflated or stored; pack it again", file=name)
    if is_too_dense(info, limits):
        raise BundleError(
            "zip-bomb",
            f"it unpacks from {info.compress_size} to {info.file_size} bytes; "
            f"a ratio of {limits.max_ratio:g} is allowed: pack it without compression",
            file=name,
        )


def is_too_dense(info: zipfile.ZipInfo, limits: BundleLimits) -> bool:
    """Whether the entry unpacks to more than its packed size allows."""
    allowed = max(limits.ratio_floor_bytes, limits.max_ratio * info.compress_size)
    return info.file_size > allowed


#: The first time that a zip can express; any fixed time would do.
_TIMESTAMP: Final = (1980, 1, 1, 0, 0, 0)
_FILE_ATTRIBUTES: Final = 0o100644 << 16
_FOLDER_ATTRIBUTES: Final = 0o040755 << 16 | 0x10  # 0x10 is a folder to DOS
_UNIX: Final = 3


def zip_entry(name: str) -> zipfile.ZipInfo:
    """Return an entry for writing: of a file, or of a folder where the name ends with a slash.

    It has no times and no owners, so that a zip has the same bytes whenever it is written.
    """
    info = zipfile.ZipInfo(name, date_time=_TIMESTAMP)
    info.create_system = _UNIX
    info.external_attr = _FOLDER_ATTRIBUTES if name.endswith("/") else _FILE_ATTRIBUTES
    return info
