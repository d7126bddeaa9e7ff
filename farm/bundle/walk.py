"""Reads a scene as Mitsuba will: every XML file that it includes, every file that it names.

Where Mitsuba 3.9.1 looks for a file was found by trying it
(`tests/farm/bundle/test_bundle_mitsuba.py` tries it again), for scenes loaded with
`mitsuba.load_file`:

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

A few kilobytes can include a file, or name one, millions of times. So what would be found again is
not looked for again: a file that is included a second time, with the same parameters in effect and
the same folders, is counted and not read, and a name that leads somewhere is followed once.
"""

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from plateau.farm.bundle.film import Cast, Film, Property, Sensor
from plateau.farm.bundle.limits import BundleError, BundleLimits, brief, shown
from plateau.farm.bundle.parameters import Parameters
from plateau.farm.bundle.references import References, Role
from plateau.farm.bundle.tree import Parts, Tree, is_absolute, leaves_upwards, put_first
from plateau.farm.bundle.xml import NOTHING, XmlBudget, XmlCost, read_elements

_PLUGIN_NAME = re.compile(r"[A-Za-z0-9_]+")
#: No plugin's name is longer, and a search for one like it takes its time.
_LONGEST_PLUGIN = 40
#: Elements that stand for a plugin.
_OBJECTS = frozenset(
    [
        *("bsdf", "emitter", "field", "film", "integrator", "medium", "phase", "rfilter"),
        *("sampler", "scene", "sensor", "shape", "spectrum", "texture", "volume"),
    ]
)


@dataclass
class Scene:
    """All that a scene's XML says that matters before Mitsuba sees it."""

    parameters: Parameters
    references: References
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
    scene = Scene(Parameters(parameters, limits, budget), References(tree, budget))
    walk = _Walk(tree, limits, scene, budget)
    walk.read(entry, (entry[:-1],), including=(), holder=_ROOT)
    return scene


@dataclass(frozen=True)
class _Holder:
    """What an open element is to its children."""

    owner: Sensor | Film | None
    #: whether a sensor in here is one of the scene's, not part of another sensor or scene
    is_stage: bool


_ROOT = _Holder(None, is_stage=True)


@dataclass
class _Reading:
    """What one reading of an XML file came to, for the next time that it is included."""

    #: the file, and those that it includes, directly or not
    files: set[Parts]
    #: how deep includes are nested below it
    height: int = 0
    cost: XmlCost = NOTHING

    def add(self, included: "_Reading") -> None:
        """Take in what a file came to that this one includes."""
        self.files |= included.files
        self.height = max(self.height, included.height + 1)


class _Walk:
    """One reading of a scene, over all of its XML files."""

    def __init__(self, tree: Tree, limits: BundleLimits, scene: Scene, budget: XmlBudget) -> None:
        self.tree = tree
        self.limits = limits
        self.scene = scene
        self.budget = budget
        #: counts what is said of sensors and films, which a second reading says again
        self.changes_of_cast = 0
        #: readings that changed nothing which lasts, by all that they depend on
        self._known: dict[tuple[Parts, tuple[Parts, ...], int, bool], _Reading] = {}

    def include(
        self,
        path: Parts,
        folders: tuple[Parts, ...],
        including: tuple[Parts, ...],
        holder: _Holder,
        at: tuple[str, int],
    ) -> _Reading:
        """Read an XML file where one includes it, or count it where it would say nothing new."""
        self.budget.spend("includes", 1, *at)
        key = (path, folders, self.scene.parameters.revision, holder.is_stage)
        known = self._known.get(key) if holder.owner is None else None
        if (
            known is not None
            # Otherwise reading it again will say what is wrong, and where.
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
        self,
        path: Parts,
        folders: tuple[Parts, ...],
        including: tuple[Parts, ...],
        holder: _Holder,
    ) -> _Reading:
        """Read one XML file, and those that it includes where it includes them."""
        before = self.budget.spent
        file = _File(self, path, folders, including, holder)
        with self.tree.open(path) as stream:
            read_elements(stream, file.name, self.budget, file.start, file.end)
        if not including:
            self.scene.references.follow_plugin_files(file.folders)
        file.reading.cost = self.budget.spent - before
        return file.reading


class _File:
    """The reading of one XML file: what `read_elements` calls."""

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
        #: where names led since the folders are as they are
        self._followed: dict[tuple[Role, str], Parts] = {}

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
        self._open.append(self._enter(tag, attributes, holder, line, is_root=is_root))
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

    def _enter(
        self, tag: str, attributes: dict[str, str], holder: _Holder, line: int, *, is_root: bool
    ) -> _Holder:
        """Return what the children of this element are in, and take note of sensors and films."""
        if tag == "scene":
            # The root of an included scene dissolves into whatever includes it.
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
            raise BundleError(
                "plugin-name",
                f"{shown(plugin)} is not the name of a plugin: letters, digits and _ are allowed",
                file=self.name,
                line=line,
            )
        known = self._walk.limits.plugins
        if known and plugin not in known:
            nearest = difflib.get_close_matches(plugin[:_LONGEST_PLUGIN], known, n=1)
            guess = f"; did you mean {nearest[0]!r}?" if nearest else ""
            raise BundleError(
                "unknown-plugin",
                f"Mitsuba has no plugin of the type {shown(plugin)}{guess} "
                "(PLATEAU_PLUGINS names those that workers have beside Mitsuba's)",
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
        folders = (self._path[:-1], *self.folders)
        self.reading.add(self._walk.include(path, folders, including, holder, at=(self.name, line)))

    def _string(self, name: str, value: str, line: int) -> None:
        if name == "filename":
            self._walk.scene.references.name_plugin_file(value, self.name, line)
        # No plugin of Mitsuba's takes a path by any other name; should one, it stays inside.
        elif is_absolute(value) or leaves_upwards(value):
            raise BundleError(
                "path-escape",
                f"{shown(name)} looks like a path out of the bundle: {shown(value)}",
                file=self.name,
                line=line,
            )

    def _follow(self, role: Role, text: str, line: int) -> Parts:
        """Follow a name that is looked up at its line, each once while the folders stay."""
        if (role, text) not in self._followed:
            # An `<include>` and a `<path>` look in the file's own folder first.
            own = () if role == "file" else (self._path[:-1],)
            folders = (*own, *self.folders)
            follow = self._walk.scene.references.follow
            self._followed[role, text] = follow(role, folders, text, self.name, line)
        return self._followed[role, text]
