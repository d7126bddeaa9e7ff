"""The files and folders that a scene names, each followed once and kept once."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

from plateau.farm.bundle.limits import BundleError, shown
from plateau.farm.bundle.tree import EntryKind, EscapeError, Parts, Tree, find, suggestion
from plateau.farm.bundle.xml import XmlBudget

Role = Literal["include", "file", "folder"]


@dataclass(frozen=True)
class Reference:
    """A file or folder that a scene names, and where it was found."""

    role: Role
    text: str
    path: Parts
    #: folders on the way; `..` needs them to exist
    visited: frozenset[Parts]
    #: of the first mention
    file: str = field(compare=False)
    line: int = field(compare=False)
    plugin: str = field(compare=False)  #: that reads the file; "" for none


class References:
    """The references of one scene, each once, in the order of their first mention."""

    def __init__(self, tree: Tree, budget: XmlBudget) -> None:
        self._tree = tree
        self._budget = budget
        self._met: dict[Reference, None] = {}
        #: plugins' files by their names in the scene; file, line and plugin of the first mention
        self._named: dict[str, tuple[str, int, str]] = {}

    def __iter__(self) -> Iterator[Reference]:
        return iter(self._met)

    def name_plugin_file(self, text: str, plugin: str, file: str, line: int) -> None:
        """Remember a plugin's file until the scene's list of folders is complete."""
        if text not in self._named:
            self._budget.spend("references", 1, file, line)
            self._named[text] = (file, line, plugin)

    def follow_plugin_files(self, folders: tuple[Parts, ...]) -> None:
        """Look the plugins' files up in the scene's folders."""
        for text, at in self._named.items():
            self.follow("file", folders, text, *at)

    def follow(
        self,
        role: Role,
        folders: tuple[Parts, ...],
        text: str,
        file: str,
        line: int,
        plugin: str = "",
    ) -> Parts:
        """Return where a reference leads; `BundleError` where nothing of the role is there."""
        try:
            found = find(self._tree, folders, text)
        except EscapeError as error:
            raise BundleError(
                "path-escape",
                f"{shown(text)} {str(error) or self._tree.outside}",
                file=file,
                line=line,
            ) from None
        self._budget.spend("lookups", found.lookups + len(folders), file, line)
        expected: EntryKind = "folder" if role == "folder" else "file"
        if found.path is None or found.kind != expected:
            problem = f"is not a {expected}" if found.kind else self._tree.remedy
            problem += "" if found.kind else suggestion(self._tree, folders, text)
            raise BundleError("missing-file", f"{shown(text)} {problem}", file=file, line=line)
        reference = Reference(role, text, found.path, found.visited, file, line, plugin)
        if reference not in self._met:
            self._budget.spend("references", 1, file, line)
            self._met[reference] = None
        return found.path
