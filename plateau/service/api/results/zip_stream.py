"""A zip that is written while it is sent, so that neither memory nor disk holds it."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime
from typing import Final
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile, ZipInfo

#: What is smaller compressed; images are compressed already.
_TEXT: Final = (".csv", ".html", ".json", ".svg", ".txt")
_MODE: Final = 0o644 << 16  #: of a file, as Unix has it


@dataclass(frozen=True)
class ZipEntry:
    """A file of a zip."""

    name: str
    chunks: Iterable[bytes]  #: read when it is its turn
    size: int  #: in bytes; of one that is no less than it will be, the format is chosen
    at: datetime


def zipped(entries: Iterable[ZipEntry]) -> Iterator[bytes]:
    """The bytes of a zip with these files, each read when it is its turn."""
    sink = _Sink()
    with ZipFile(sink, "w") as archive:
        for entry in entries:
            info = ZipInfo(entry.name, entry.at.timetuple()[:6])
            info.compress_type = ZIP_DEFLATED if entry.name.endswith(_TEXT) else ZIP_STORED
            info.external_attr = _MODE
            info.file_size = entry.size
            with archive.open(info, "w") as file:
                for chunk in entry.chunks:
                    file.write(chunk)
                    yield sink.taken()
    yield sink.taken()


class _Sink:
    """Takes what a zip is written to, in order: without `tell` and `seek` nothing is changed."""

    def __init__(self) -> None:
        self._written = bytearray()

    def write(self, data: bytes) -> int:
        self._written += data
        return len(data)

    def flush(self) -> None:
        """Do nothing: what was written is there to be taken."""

    def close(self) -> None:
        """Do nothing, likewise."""

    def taken(self) -> bytes:
        """What was written since the last call."""
        taken, self._written = bytes(self._written), bytearray()
        return taken
