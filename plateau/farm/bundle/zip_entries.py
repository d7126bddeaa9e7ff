"""Entries of zips that have the same bytes whenever they are written: no times, no owners."""

import zipfile
from typing import Final

#: The first time that a zip can express; any fixed time would do.
_TIMESTAMP: Final = (1980, 1, 1, 0, 0, 0)
_FILE_ATTRIBUTES: Final = 0o100644 << 16
_FOLDER_ATTRIBUTES: Final = 0o040755 << 16 | 0x10  # 0x10 is a folder to DOS
_UNIX: Final = 3


def zip_entry(name: str) -> zipfile.ZipInfo:
    """Return the entry of a file, or of a folder where the name ends with a slash."""
    info = zipfile.ZipInfo(name, date_time=_TIMESTAMP)
    info.create_system = _UNIX
    info.external_attr = _FOLDER_ATTRIBUTES if name.endswith("/") else _FILE_ATTRIBUTES
    return info
