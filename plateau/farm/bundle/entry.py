"""Which file of a bundle is the scene."""

from dataclasses import dataclass, field

from plateau.farm.bundle.archive import Archive
from plateau.farm.bundle.formats import MITSUBA_XML, with_suffix
from plateau.farm.bundle.limits import BundleError, BundleLimits, brief
from plateau.farm.bundle.parameters import Parameters
from plateau.farm.bundle.tree import EscapeError, Parts, find, put_first
from plateau.farm.bundle.xml import BudgetSpent, XmlBudget, read_elements

#: What macOS adds to an archive besides the real files.
_MACOS_FOLDER = "__MACOSX"


def find_entry(archive: Archive, limits: BundleLimits) -> Parts:
    """Return the scene's XML in an archive, or a file of another format where it has no such XML.

    Candidates are the XML files with the root `<scene>` that no other includes: `scene.xml` at the
    top, or in the one folder at the top; otherwise the file at the shallowest level. A job's
    parameters do not matter, so that one bundle is one scene. Of other formats all files are
    candidates, since they may refer to each other. A bundle of scene roots' files names it.

    Raises
    ------
    BundleError
        No file is the scene (`not-a-scene`), or several at that level (`ambiguous-scene`).
    """
    if archive.placed is not None:
        return tuple(archive.placed.entry.split("/"))
    files = sorted(path for path in archive.files if path[0] != _MACOS_FOLDER)
    documents = [path for path in files if path[-1].casefold().endswith(".xml")]
    if documents == [(MITSUBA_XML.entry,)]:
        return documents[0]
    budget = XmlBudget(limits)
    skims = {path: _skim(archive, path, budget, limits) for path in documents}
    scenes = [path for path, skim in skims.items() if skim.root == "scene"]
    if not scenes:
        for other in with_suffix():
            named = [path for path in files if other.is_named(path)]
            if named:
                return _chosen(archive, named, files, other.entry)
        others = "".join(f", or a {other.suffix}" for other in with_suffix())
        raise BundleError(
            "not-a-scene",
            f"the archive has no scene: an .xml file that starts with <scene>{others}",
        )
    included = {path for skim in skims.values() for path in skim.includes}
    # If each is included by another, reading the scene reports the cycle.
    candidates = [path for path in scenes if path not in included] or scenes
    return _chosen(archive, candidates, files, MITSUBA_XML.entry)


def _chosen(archive: Archive, candidates: list[Parts], files: list[Parts], name: str) -> Parts:
    """Return the candidate of that name at the top, or else the one at the shallowest level."""
    tops = {path[0] for path in files}
    named = {(name,)} | {(top, name) for top in tops if len(tops) == 1}
    for path in sorted(named.intersection(candidates), key=len):
        return path
    shallowest = min(len(path) for path in candidates)
    candidates = [path for path in candidates if len(path) == shallowest]
    if len(candidates) > 1:
        shown = ", ".join(brief(archive.label(path)) for path in candidates[:5])
        raise BundleError(
            "ambiguous-scene",
            f"{len(candidates)} files could be the scene ({shown}); "
            f"name the right one {name} and put it at the top",
        )
    return candidates[0]


@dataclass
class _Skim:
    """The root and the includes of one XML file, without the job's parameters."""

    root: str | None = None
    includes: set[Parts] = field(default_factory=set)


def _skim(archive: Archive, document: Parts, budget: XmlBudget, limits: BundleLimits) -> _Skim:
    """Return an XML file's root and includes, as far as they can be read and followed."""
    skim = _Skim()
    name = archive.label(document)
    folders: tuple[Parts, ...] = (document[:-1],)
    parameters = Parameters({}, limits, budget)

    def start(tag: str, raw: dict[str, str], line: int) -> None:
        nonlocal folders
        skim.root = skim.root or tag
        if tag not in ("default", "include", "path"):
            return
        try:
            attributes = {key: parameters.substitute(text, name, line) for key, text in raw.items()}
            if tag == "default":
                key, value = attributes.get("name", ""), attributes.get("value", "")
                parameters.add_default(key, value, name, line)
                return
            found = find(
                archive, folders, attributes.get("filename") or attributes.get("value", "")
            )
        except BudgetSpent:
            raise
        except (BundleError, EscapeError):
            return  # Reading the scene reports it, if the scene reads this file at all.
        budget.spend("lookups", found.lookups + len(folders), name, line)
        if tag == "include" and found.path is not None:
            skim.includes.add(found.path)
        elif tag == "path" and found.path is not None:
            folders = put_first(found.path, folders)

    try:
        with archive.open(document) as stream:
            read_elements(stream, name, budget, start, lambda: None)
    except BudgetSpent:
        raise
    except BundleError:
        pass  # A broken file beside the scene does no harm, unless reading it costs too much.
    return skim
