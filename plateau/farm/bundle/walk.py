"""Reads a scene as Mitsuba will: every XML file that it includes, every file that it names.

Trials showed where Mitsuba 3.9.1 looks for a file of a scene loaded with `mitsuba.load_file`
(`tests/farm/bundle/test_bundle_mitsuba.py` repeats them):

- Each XML file has a list of folders. The scene's own list starts with its folder. A `<path>` puts
  a folder in front.
- `<include>` and `<path>` look in the folder of their XML file, then in the folders of its list at
  that line.
- `<spectrum filename>` looks only in the folders of the list at that line (the scene's list has the
  scene's folder).
- An included file starts with the including file's list and that file's folder in front. Its own
  `<path>` folders are dropped at its end.
- `<string name="filename">` is looked up when the plugin is made, after all XML is read: in the
  folders of the *scene's* list, even when it stands in an included file in another folder.
- Mitsuba then looks in its own folder and in the working folder. Neither is the scene's, so here
  the file is missing.

A few kilobytes can include a file, or name one, millions of times. So a file that is included
again with the same parameters and folders is counted and not read, and each name is followed once.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from plateau.farm.bundle.film import Cast, Film, Property, Sensor
from plateau.farm.bundle.limits import BundleError, BundleLimits, brief, shown
from plateau.farm.bundle.old_scenes import OldScene
from plateau.farm.bundle.parameters import Parameters
from plateau.farm.bundle.plugins import guess
from plateau.farm.bundle.references import References, Role
from plateau.farm.bundle.tree import Parts, Tree, is_absolute, leaves_upwards, put_first
from plateau.farm.bundle.xml import XmlBudget, XmlCost, read_elements

_PLUGIN_NAME = re.compile(r"[A-Za-z0-9_]+")
_WHOLE = "stokes"
#: Elements that stand for a plugin.
_OBJECTS = frozenset(
    [
        *("bsdf", "emitter", "field", "film", "integrator", "medium", "phase", "rfilter"),
        *("sampler", "scene", "sensor", "shape", "spectrum", "texture", "volume"),
    ]
)


@dataclass
class Scene:
    """The parts of a scene's XML that matter before Mitsuba sees it."""

    parameters: Parameters
    references: References
    cast: Cast = field(default_factory=Cast)
    #: whether its integrator renders whole films alone, as Mitsuba's scalar variants do
    is_whole: bool = False


def read_scene(
    tree: Tree, entry: Parts, parameters: Mapping[str, str], limits: BundleLimits
) -> Scene:
    """Read a scene's XML, `entry` of the tree, with all that it includes.

    `parameters` has the job's values for the scene's `$parameters`.

    Raises
    ------
    BundleError
        The XML is malformed, or a reference is missing or leaves the tree.
    """
    budget = XmlBudget(limits)
    scene = Scene(Parameters(parameters, limits, budget), References(tree, budget))
    walk = _Walk(tree, limits, scene, budget)
    walk.read(entry, (entry[:-1],), including=(), holder=_ROOT)
    walk.old.check()
    return scene


@dataclass(frozen=True)
class _Holder:
    """An open element, as its children need to know it."""

    owner: Sensor | Film | None
    #: whether a sensor in here is the scene's own, not part of another sensor or scene
    is_stage: bool


_ROOT = _Holder(None, is_stage=True)


@dataclass
class _Reading:
    """The result of reading an XML file, for the next time that it is included."""

    #: the file, and those that it includes, directly or not
    files: set[Parts]
    #: depth of the includes below it
    height: int = 0
    cost: XmlCost = field(init=False)

    def add(self, included: "_Reading") -> None:
        """Take in the reading of an included file."""
        self.files |= included.files
        self.height = max(self.height, included.height + 1)


class _Walk:
    """One reading of a scene, over all of its XML files."""

    def __init__(self, tree: Tree, limits: BundleLimits, scene: Scene, budget: XmlBudget) -> None:
        self.tree = tree
        self.limits = limits
        self.scene = scene
        self.budget = budget
        self.old = OldScene(limits.plugins)
        #: counts the declarations of sensors and films, which a second reading must repeat
        self.changes_of_cast = 0
        #: readings that declared no parameter, sensor or film, by all that they depend on
        self._known: dict[tuple[Parts, tuple[Parts, ...], int, bool], _Reading] = {}

    def include(
        self,
        path: Parts,
        folders: tuple[Parts, ...],
        including: tuple[Parts, ...],
        holder: _Holder,
        at: tuple[str, int],
    ) -> _Reading:
        """Read an included XML file, or count it where a reading would add nothing."""
        self.budget.spend("includes", 1, *at)
        key = (path, folders, self.scene.parameters.revision, holder.is_stage)
        known = self._known.get(key) if holder.owner is None else None
        if (
            known is not None
            # Otherwise a second reading reports what is wrong, and where.
            and len(including) + known.height < self.limits.max_include_depth
            and known.files.isdisjoint(including)
        ):
            self.budget.spend_again(known.cost, *at)
            return known
        changes = self.changes_of_cast
        reading = self.read(path, folders, including, holder)
        if (key[2], changes) == (self.scene.parameters.revision, self.changes_of_cast):
            self._known[key] = reading
        return reading

    def read(
        self, path: Parts, folders: tuple[Parts, ...], including: tuple[Parts, ...], holder: _Holder
    ) -> _Reading:
        """Read one XML file, with its includes in place."""
        before = self.budget.spent
        file = _File(self, path, folders, including, holder)
        with self.tree.open(path) as stream:
            read_elements(stream, file.name, self.budget, file.start, file.end)
        if not including:
            self.scene.references.follow_plugin_files(file.folders)
        file.reading.cost = self.budget.spent - before
        return file.reading


class _File:
    """The reading of one XML file: `read_elements` calls `start` and `end`."""

    def __init__(
        self,
        walk: _Walk,
        path: Parts,
        folders: tuple[Parts, ...],
        including: tuple[Parts, ...],
        holder: _Holder,
    ) -> None:
        self.name = walk.tree.label(path)
        self.folders = folders
        self.reading = _Reading({path})
        self._walk = walk
        self._path = path
        self._including = including
        self._open = [holder]
        self._plugins: list[str] = []  #: types of the open elements
        self._is_old = False  #: whether it is for a Mitsuba before 2
        self._unturned = 0  #: the line of an open emitter without a transform; 0 for none
        #: where names lead, as long as the folders stay
        self._followed: dict[tuple[Role, str], Parts] = {}

    def start(self, tag: str, raw: dict[str, str], line: int) -> None:
        """Take in an element as it starts, as Mitsuba's parser does: in document order."""
        is_root = len(self._open) == 1
        if is_root and not self._including and tag != "scene":
            raise self._refusal("not-a-scene", f"it starts with <{tag[:40]}>, not <scene>", line)
        substitute = self._walk.scene.parameters.substitute
        attributes = {key: substitute(text, self.name, line) for key, text in raw.items()}
        if is_root:
            self._is_old = self._walk.old.is_old(attributes.get("version", ""))
        if not self._is_old or not self._walk.old.meet(tag, attributes, self.name, line):
            self._check_plugin(tag, attributes, line)
        if attributes.get("type") == _WHOLE and tag == "integrator":
            self._walk.scene.is_whole = True
        if self._is_old:
            self._unturned = line if tag == "emitter" else self._unturned * (tag != "transform")
        holder = self._open[-1]
        self._open.append(self._enter(tag, attributes, holder, line, is_root=is_root))
        self._plugins.append(attributes.get("type", ""))
        match tag:
            case "default":
                name, value = attributes.get("name", ""), attributes.get("value", "")
                self._walk.scene.parameters.add_default(name, value, self.name, line)
            case "include":
                self._include(attributes.get("filename", ""), holder, line)
            case "path":
                folder = self._follow("folder", attributes.get("value", ""), line)
                if folder not in self.folders[:1]:
                    self.folders = put_first(folder, self.folders)
                    self._followed = {}
            case "spectrum" if "filename" in attributes:
                self._follow("file", attributes["filename"], line)
            case "string":
                self._string(attributes.get("name", ""), attributes.get("value", ""), line)
            case "ref" if isinstance(holder.owner, Sensor):
                holder.owner.references.append(attributes.get("id", ""))
            case "alias":
                self._walk.changes_of_cast += 1
                aliases = self._walk.scene.cast.aliases
                aliases[attributes.get("as", "")] = attributes.get("id", "")
        if isinstance(holder.owner, Film) and tag not in _OBJECTS:
            text = attributes.get("value", "")
            holder.owner.set(attributes.get("name", ""), Property(tag, text, self.name, line))

    def end(self) -> None:
        """Leave an element."""
        self._open.pop()
        plugin = self._plugins.pop()
        if self._unturned and plugin:
            self._walk.old.without_up(plugin, self.name, self._unturned)
            self._unturned = 0

    def _enter(
        self, tag: str, attributes: dict[str, str], holder: _Holder, line: int, *, is_root: bool
    ) -> _Holder:
        """Return the holder of this element's children, and note sensors and films."""
        if tag == "scene":
            # The root of an included scene is replaced by its children.
            return holder if is_root else _Holder(None, is_stage=False)
        cast = self._walk.scene.cast
        if tag in ("sensor", "film"):
            self._walk.budget.spend("sensors", 1, self.name, line)
            self._walk.changes_of_cast += 1
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
        if tag not in _OBJECTS or plugin is None:
            return
        if not _PLUGIN_NAME.fullmatch(plugin):
            raise self._refusal(
                "plugin-name",
                f"{shown(plugin)} is not the name of a plugin: letters, digits and _ are allowed",
                line,
            )
        known = self._walk.limits.plugins
        if known and plugin not in known:
            raise self._refusal(
                "unknown-plugin",
                f"Mitsuba has no plugin of the type {shown(plugin)}{guess(plugin, known)} "
                "(PLATEAU_PLUGINS names those that workers have besides Mitsuba's)",
                line,
            )

    def _include(self, text: str, holder: _Holder, line: int) -> None:
        path = self._follow("include", text, line)
        including = (*self._including, self._path)
        if path in including:
            chain = " → ".join(brief(self._walk.tree.label(each)) for each in (*including, path))
            raise self._refusal("include-cycle", f"it includes itself: {chain}", line)
        most = self._walk.limits.max_include_depth
        if len(including) >= most:
            raise self._refusal("include-depth", f"includes are nested more than {most} deep", line)
        folders = (self._path[:-1], *self.folders)
        self.reading.add(self._walk.include(path, folders, including, holder, at=(self.name, line)))

    def _string(self, name: str, value: str, line: int) -> None:
        if name == "filename":
            plugin = "".join(self._plugins[-2:-1])
            self._walk.scene.references.name_plugin_file(value, plugin, self.name, line)
        # No plugin of Mitsuba's takes a path by any other name; should one, it stays inside.
        elif is_absolute(value) or leaves_upwards(value):
            raise self._refusal(
                "path-escape",
                f"{shown(name)} looks like a path out of the bundle: {shown(value)}",
                line,
            )

    def _refusal(self, code: str, message: str, line: int) -> BundleError:
        return BundleError(code, message, file=self.name, line=line)

    def _follow(self, role: Role, text: str, line: int) -> Parts:
        """Follow a name that is looked up at its line, once while the folders stay."""
        if (role, text) not in self._followed:
            # An `<include>` and a `<path>` look in the file's own folder first.
            own = () if role == "file" else (self._path[:-1],)
            folders = (*own, *self.folders)
            follow = self._walk.scene.references.follow
            self._followed[role, text] = follow(role, folders, text, self.name, line)
        return self._followed[role, text]
