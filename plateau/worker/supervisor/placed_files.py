"""Files of scene roots that a scene names: compared with its list, and linked beside its XML."""

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final
from uuid import uuid4

from plateau.farm.bundle.hashes import Content, FileChanges, FileHashes
from plateau.farm.bundle.placed import LIST_NAME, Placed, with_paths
from plateau.farm.model.errors import FilesDiffer, StoreUnavailable
from plateau.farm.model.scene_roots import SceneRoot

#: How many files an error names.
_NAMED: Final = 3


class PlacedFiles:
    """The scene roots of one machine.

    Parameters
    ----------
    roots
        Those that are there.
    hashes
        Reads the files that are new or have changed.
    """

    def __init__(self, roots: Iterable[SceneRoot], hashes: FileHashes) -> None:
        self._roots = {root.name: root.path for root in roots}
        self._hashes = hashes

    @property
    def folders(self) -> tuple[Path, ...]:
        """The folders beneath which a render child has to open files."""
        return tuple(self._roots.values())

    def name(self, folder: Path, home: Path) -> None:
        """Write this machine's paths into the XML of a scene that is unpacked in a folder.

        `home` is where the folder will lie.
        """
        placed = list_of(folder)
        if placed is None:
            return
        for path in folder.rglob("*"):
            if path.is_file() and path.name != LIST_NAME:
                path.write_bytes(with_paths(path.read_bytes(), placed.roots, home))

    def link(self, folder: Path) -> tuple[str, ...]:
        """Compare the files that a scene names with its list, and link them into its folder.

        Returns the names of its roots: none for a scene that holds all of its files. To call before
        each time that the scene is loaded, and again afterwards; only changed files are read again.

        Raises
        ------
        FilesDiffer
            A file is missing, or is another than the scene was submitted with.
        StoreUnavailable
            A file cannot be read at this time.
        """
        placed = list_of(folder)
        if placed is None:
            return ()
        differ = []
        for name, content in placed.files.items():
            trouble = self._compare(folder, name, content)
            if trouble is not None:
                root, _, rest = name.partition("/")
                differ.append(f"{{{root}}}/{rest} {trouble}")
        if differ:
            others = f", and {len(differ) - _NAMED} more" if len(differ) > _NAMED else ""
            raise FilesDiffer(
                f"this worker does not see the scene as it was submitted: "
                f"{'; '.join(differ[:_NAMED])}{others}"
            )
        return placed.roots

    def _compare(self, folder: Path, name: str, expected: Content) -> str | None:
        """Link a file; return what is wrong with it, if anything is."""
        root, _, rest = name.partition("/")
        if root not in self._roots:
            return "is in a root that it does not have"
        try:
            top = self._roots[root].resolve(strict=True)
            path = self._roots[root].joinpath(rest).resolve(strict=True)
            if not path.is_relative_to(top):
                return "is a link that leads out of its root"
            size = path.stat().st_size
            if size != expected.bytes:
                return f"has {size} bytes, not {expected.bytes}"
            if self._hashes.content(path) != expected:
                return "has other content"
        except (FileNotFoundError, NotADirectoryError, RuntimeError):
            return "is missing"
        except PermissionError:
            return "may not be read"
        except FileChanges:
            return "is being changed"
        except OSError as error:
            raise StoreUnavailable(f"{name} cannot be read: {error.strerror or error}") from error
        _link(folder / name, path)
        return None


#: For a machine without scene roots.
NO_ROOTS: Final = PlacedFiles((), FileHashes(Path(os.devnull)))


def list_of(folder: Path) -> Placed | None:
    """Return the list of an unpacked scene; None if it holds all of its files."""
    try:
        return Placed.from_json((folder / LIST_NAME).read_bytes())
    except FileNotFoundError:
        return None


def _link(link: Path, to: Path) -> None:
    """Make a link lead there; workers of one machine may do so at once."""
    with suppress(OSError):
        if link.readlink() == to:
            return
    making = link.with_name(f".{uuid4().hex}")
    making.symlink_to(to)
    making.rename(link)
