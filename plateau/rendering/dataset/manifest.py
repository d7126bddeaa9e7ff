"""The folder of a data set: its files, and ``manifest.jsonl``, which says what each image is.

A file is written beside its place, synced, and moved there; then the image's line is appended and
synced. So an image that has a line is there whole, whatever was killed. The last line of an index
counts: an image that failed may be there after a later run.
"""

import errno
import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path, PurePath
from typing import IO, Any, Final

from plateau.errors import CommandFailed
from plateau.farm.process.durable import sync
from plateau.files.held import held
from plateau.files.out_folder import make_writable
from plateau.rendering.mapped import Task

NAME: Final = "manifest.jsonl"
_PART: Final = ".plateau-part"
_FULL: Final = (errno.ENOSPC, errno.EDQUOT)
FAILED: Final = "failed"


class Manifest:
    """The images that a folder has, by their places in the recipe; nobody else writes there."""

    def __init__(self, folder: Path, lines: dict[int, dict[str, Any]], file: IO[bytes]) -> None:
        self.folder = folder
        self.lines = lines
        self._file = file

    def has(self, index: int) -> bool:
        """Whether the image is there whole: its line, and its files in their sizes."""
        line = self.lines.get(index)
        if line is None or line["state"] == FAILED:
            return False
        paths = ((self.folder / name, size) for name, size in line["files"].items())
        return all(path.is_file() and path.stat().st_size == size for path, size in paths)

    def add(self, line: dict[str, Any], files: Mapping[str, bytes]) -> None:
        """Write the files of an image, and then its line.

        Raises
        ------
        CommandFailed
            The disk is full, or takes no files; nothing of the image is left.
        """
        line = {**line, "files": {name: len(content) for name, content in files.items()}}
        try:
            for name, content in files.items():
                self._write(self.folder / name, content)
            sync(self.folder)
            self._append(line)
        except OSError as error:
            hint = "free some space" if error.errno in _FULL else "see to the folder"
            raise CommandFailed(
                f"image {line['index']} cannot be written into {self.folder} "
                f"({error.strerror or error}): {hint}, and run the same command again, which goes "
                "on from here"
            ) from error
        self.lines[line["index"]] = line

    def _write(self, path: Path, content: bytes) -> None:
        part = path.with_name(f"{path.name}{_PART}")
        try:
            part.write_bytes(content)
            sync(part)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)

    def _append(self, line: Mapping[str, Any]) -> None:
        end = self._file.seek(0, os.SEEK_END)
        rest = memoryview(json.dumps(line).encode() + b"\n")
        try:
            while rest:  # a disk that is nearly full takes a part
                rest = rest[self._file.write(rest) :]
            os.fsync(self._file.fileno())
        except OSError:
            with suppress(OSError):
                self._file.truncate(end)  # no half line
            raise


@contextmanager
def opened(folder: Path) -> Iterator[Manifest]:
    """The manifest of a folder, which is made and held for as long as the context lasts.

    Raises
    ------
    Held
        Another run writes there.
    CommandFailed
        Files cannot be written there, or its manifest is none of ours.
    """
    make_writable(folder)
    with held(folder), (folder / NAME).open("ab+", buffering=0) as file:
        for left in folder.glob(f"*{_PART}"):
            left.unlink()
        yield Manifest(folder, _read(file, folder / NAME), file)


def _read(file: IO[bytes], path: Path) -> dict[int, dict[str, Any]]:
    """The last line of each index; a line that a kill has cut short is taken away."""
    file.seek(0)
    content = file.read()
    whole = content.rfind(b"\n") + 1
    if whole < len(content):
        file.truncate(whole)
    lines: dict[int, dict[str, Any]] = {}
    for number, text in enumerate(content[:whole].splitlines(), start=1):
        try:
            line = json.loads(text)
            _ = line["state"], line["files"], line["digest"]
            lines[int(line["index"])] = line
        except (ValueError, KeyError, TypeError):
            raise CommandFailed(
                f"line {number} of {path} is none of a data set's: mend it, or give another folder "
                "with -o"
            ) from None
    return lines


def identity(task: Task, asked: Mapping[str, Any], files_sha256: str) -> dict[str, Any]:
    """What decides an image: two images with the same are the same to the bit."""
    return {
        "scene": PurePath(task.scene_name).name,  # its folder may move
        "scene_files": files_sha256,
        "parameters": dict(task.parameters),
        "sensor": task.sensor,
        "asked": dict(asked),
    }


def digest(found: Mapping[str, Any]) -> str:
    """A short hash of what decides an image."""
    text = json.dumps(found, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
