"""Reads a scene as Mitsuba will: every XML file that it includes, every file that it names.

Where Mitsuba 3.9.1 looks for a file was found by trying it (`tests/farm/test_bundle_mitsuba.py`
tries it again), for scenes loaded with `mitsuba.load_file`:

- Each XML file has a list of folders. The scene's own list starts as its folder. A `<path>` puts
  one more in front.
- `<include>` and `<path>` look in the folder of the XML file that they stand in, then along that
  file's list as it is at that line.
- `<spectrum filename>` looks along the list as it is at that line, and not in the file's folder
  (for the scene itself that folder is on the list anyway).
- An included file starts with the list of the file that includes it, with that file's folder in
  front. What it adds by `<path>` is forgotten when it ends.
- `<string name="filename">` is looked up when the plugin is made, after all XML is read: along the
  *scene's* list, even when it stands in an included file in some other folder.
- What is found nowhere is looked up in Mitsuba's own folder and in the working folder. Neither is
  the scene's, so here it is missing.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from farm.bundle.film import Cast, Film, Property, Sensor
from farm.bundle.parameters import Parameters
from farm.bundle.rules import BundleError, BundleLimits, brief, shown
from farm.bundle.tree import (
    EscapeError,
    Kind,
    Parts,
    Tree,
    find,
    is_absolute,
    leaves_upwards,
    put_first,
)
from farm.bundle.xml import XmlBudget, read_elements

_PLUGIN_NAME = re.compile(r"[A-Za-z0-9_]+")
#: Elements that stand for a plugin.
_OBJECTS = frozenset(
    [
        *("bsdf", "emitter", "field", "film", "integrator", "medium", "phase", "rfilter"),
        *("sampler", "scene", "sensor", "shape", "spectrum", "texture", "volume"),
    ]
)


@dataclass(frozen=True)
class Reference:
    """A file or folder that a scene names, and where it was found."""

    role: Literal["include", "file", "folder"]
    text: str
    path: Parts
    #: folders that were stood in on the way; `..` needs them to exist
    visited: frozenset[Parts]
    file: str
    line: int


@dataclass
class Scene:
    """All that a scene's XML says that matters before Mitsuba sees it."""

    parameters: Parameters
    references: list[Reference] = field(default_factory=list)
    cast: Cast = field(default_factory=Cast)


def read_scene(
    tree: Tree, entry: Parts, parameters: Mapping[str, str], limits: BundleLimits
) -> Scene:
    """Return what a scene's XML, with everything that it includes, refers to and defines.

    Parameters
    ----------
    tree : Tree
        Where its files are.
    entry : tuple of str
        The scene's XML in the tree.
    parameters : mapping of str to str
        The job's values for the scene's `$parameters`.
    limits : BundleLimits
        Bounds on the XML.

    Raises
    ------
    BundleError
        Where the XML is malformed, or a reference is missing or leaves the tree.
    """
    budget = XmlBudget(limits)
    scene = Scene(Parameters(parameters, limits, budget))
    walk = _Walk(tree, limits, scene, budget)
    walk.read(entry, [entry[:-1]], including=(), holder=_ROOT)
    walk.follow_plugin_files()
    return scene


@dataclass(frozen=True)
class _Holder:
    """What an open element is to its children."""

    owner: Sensor | Film | None
    #: whether a sensor in here is one of the scene's, not part of another sensor or scene
    is_stage: bool


_ROOT = _Holder(None, is_stage=True)


class _Walk:
    """One reading of a scene, over all of its XML files."""

    def __init__(self, tree: Tree, limits: BundleLimits, scene: Scene, budget: XmlBudget) -> None:
        self.tree = tree
        self.limits = limits
        self.scene = scene
        self._budget = budget
        #: what plugins will ask for once all XML is read: each text, its file and its line
        self._named: list[tuple[str, str, int]] = []
        self._plugin_folders: list[Parts] = []

    def read(
        self, path: Parts, folders: list[Parts], including: tuple[Parts, ...], holder: _Holder
    ) -> None:
        """Read one XML file, and those that it includes where it includes them."""
        reading = _File(self, path, folders, including, holder)
        with self.tree.open(path) as stream:
            read_elements(stream, reading.name, self._budget, reading.start, reading.end)
        if not including:
            self._plugin_folders = folders

    def name_plugin_file(self, text: str, file: str, line: int) -> None:
        """Remember a plugin's file until the scene's list of folders is complete."""
        self._named.append((text, file, line))

    def follow_plugin_files(self) -> None:
        """Look up what the plugins will ask for."""
        for text, file, line in self._named:
            self.follow("file", self._plugin_folders, text, file, line)

    def follow(
        self,
        role: Literal["include", "file", "folder"],
        folders: list[Parts],
        text: str,
        file: str,
        line: int,
    ) -> Parts:
        """Return where a reference leads, having checked that it leads to the right kind."""
        try:
            found = find(self.tree, folders, text)
        except EscapeError:
            raise BundleError(
                "path-escape",
                f"{shown(text)} leads out of the bundle; put the file into it and name it by a "
                f"relative path",
                file=file,
                line=line,
            ) from None
        self._budget.spend_lookups(found.lookups + len(folders), file, line)
        expected: Kind = "folder" if role == "folder" else "file"
        if found.path is None or found.kind != expected:
            problem = f"is not a {expected}" if found.kind else self.tree.remedy
            raise BundleError("missing-file", f"{shown(text)} {problem}", file=file, line=line)
        self.scene.references.append(
            Reference(role, text, found.path, found.visited, file=file, line=line)
        )
        return found.path


class _File:
    """The reading of one XML file: what `read_elements` calls."""

    def __init__(
        self,
        walk: _Walk,
        path: Parts,
        folders: list[Parts],
        including: tuple[Parts, ...],
        holder: _Holder,
    ) -> None:
        self._walk = walk
        self._path = path
        self._folders = folders
        self._including = including
        self._open = [holder]
        self.name = walk.tree.label(path)

    def start(self, tag: str, raw: dict[str, str], line: int) -> None:
        """Take in an element as it starts, as Mitsuba's parser does: in document order."""
        is_root = len(self._open) == 1
        if is_root and not self._including and tag != "scene":
            raise BundleError(
                "not-a-scene",
                f"it starts with <{tag[:40]}>, not <scene>",
                file=self.name,
                line=line,
            )
        substitute = self._walk.scene.parameters.substitute
        attributes = {key: substitute(text, self.name, line) for key, text in raw.items()}
        self._check_plugin(tag, attributes, line)
        holder = self._open[-1]
        self._open.append(self._enter(tag, attributes, holder, is_root=is_root))
        match tag:
            case "default":
                name, value = attributes.get("name", ""), attributes.get("value", "")
                self._walk.scene.parameters.add_default(name, value, self.name, line)
            case "include":
                self._include(attributes.get("filename", ""), holder, line)
            case "path":
                folder = self._follow("folder", attributes.get("value", ""), line)
                put_first(self._folders, folder)
            case "spectrum" if "filename" in attributes:
                walk = self._walk
                walk.follow("file", self._folders, attributes["filename"], self.name, line)
            case "string":
                self._string(attributes.get("name", ""), attributes.get("value", ""), line)
            case "ref" if isinstance(holder.owner, Sensor):
                holder.owner.references.append(attributes.get("id", ""))
            case "alias":
                aliases = self._walk.scene.cast.aliases
                aliases[attributes.get("as", "")] = attributes.get("id", "")
        if isinstance(holder.owner, Film) and tag not in _OBJECTS:
            text = attributes.get("value", "")
            holder.owner.set(attributes.get("name", ""), Property(tag, text, self.name, line))

    def end(self) -> None:
        """Leave an element."""
        self._open.pop()

    def _enter(
        self, tag: str, attributes: dict[str, str], holder: _Holder, *, is_root: bool
    ) -> _Holder:
        """Return what the children of this element are in, and take note of sensors and films."""
        if tag == "scene":
            # The root of an included scene dissolves into whatever includes it.
            return holder if is_root else _Holder(None, is_stage=False)
        cast = self._walk.scene.cast
        if tag == "sensor":
            sensor = Sensor()
            if holder.is_stage:
                cast.sensors.append(sensor)
            return _Holder(sensor, is_stage=False)
        if tag == "film":
            film = Film()
            if isinstance(holder.owner, Sensor):
                holder.owner.films.append(film)
            if "id" in attributes:
                cast.films[attributes["id"]] = film
            return _Holder(film, is_stage=False)
        return _Holder(None, holder.is_stage)

    def _check_plugin(self, tag: str, attributes: dict[str, str], line: int) -> None:
        plugin = attributes.get("type")
        if tag in _OBJECTS and plugin is not None and not _PLUGIN_NAME.fullmatch(plugin):
            raise BundleError(
                "plugin-name",
                f"{shown(plugin)} is not the name of a plugin: letters, digits and _ are allowed",
                file=self.name,
                line=line,
            )

    def _include(self, text: str, holder: _Holder, line: int) -> None:
        path = self._follow("include", text, line)
        including = (*self._including, self._path)
        if path in including:
            chain = " → ".join(brief(self._walk.tree.label(each)) for each in (*including, path))
            raise BundleError(
                "include-cycle", f"it includes itself: {chain}", file=self.name, line=line
            )
        if len(including) >= self._walk.limits.max_include_depth:
            raise BundleError(
                "include-depth",
                f"includes are nested more than {self._walk.limits.max_include_depth} deep",
                file=self.name,
                line=line,
            )
        self._walk.read(path, [self._path[:-1], *self._folders], including, holder)

    def _string(self, name: str, value: str, line: int) -> None:
        if name == "filename":
            self._walk.name_plugin_file(value, self.name, line)
        # No plugin of Mitsuba's takes a path by any other name; should one, it stays inside.
        elif is_absolute(value) or leaves_upwards(value):
            raise BundleError(
                "path-escape",
                f"{shown(name)} looks like a path out of the bundle: {shown(value)}",
                file=self.name,
                line=line,
            )

    def _follow(self, role: Literal["include", "folder"], text: str, line: int) -> Parts:
        """Follow an `<include>` or a `<path>`: these look in the file's own folder first."""
        folders = [self._path[:-1], *self._folders]
        return self._walk.follow(role, folders, text, self.name, line)
