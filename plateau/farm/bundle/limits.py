"""What an uploaded scene may be: its limits, and the one error that refuses it."""

from dataclasses import dataclass

from plateau.farm.model.errors import FarmError

MIB = 2**20
GIB = 2**30
_MAX_SHOWN = 100

#: The codes of a `BundleError`, and what they stand for. Clients switch on these. The format of a
#: renderer's scenes may have codes of its own besides.
CODES = {
    "ambiguous-scene": "several files of the bundle could be the scene",
    "bad-parameter": "a job parameter's name or value is malformed",
    "duplicate-entry": "two entries have one name, or names that differ in case alone",
    "empty": "the upload holds nothing",
    "entry-name": "an entry's name is malformed, too long or nested too deep",
    "entry-type": "an entry is a link, a device or some other special file",
    "film-size": "the film is empty, not a whole number of pixels, or too large",
    "include-cycle": "an XML file includes itself, directly or through others",
    "include-depth": "includes are nested too deep",
    "missing-file": "a referenced file or folder is not in the bundle",
    "native-code": "an entry is a shared library, which Mitsuba would load as a plugin",
    "no-sensor": "the scene has no sensor of that index",
    "not-a-scene": "the upload is neither a scene nor a zip that holds one",
    "old-scene": "the scene is for Mitsuba 0.6 or older, and has what Mitsuba 3 cannot take over",
    "path-escape": "an entry or a reference leaves the bundle",
    "plugin-name": "a plugin's type is a path, not a name",
    "too-large": "the upload is too large",
    "too-many-entries": "the archive has too many entries",
    "undefined-parameter": "the scene uses a $parameter that has neither value nor default",
    "unpackable-path": "a scene to be packed names a file by an absolute path or across a link",
    "unknown-parameter": "a job parameter is not one of the scene's",
    "unknown-plugin": "a plugin's type is none that the farm's Mitsuba has",
    "unreadable-file": "a mesh or an image is one that Mitsuba cannot read",
    "unwritable-dict": "a scene given as a Mitsuba dict has a value that no file can hold",
    "xml-depth": "XML elements are nested too deep",
    "xml-encoding": "an XML file is not UTF-8",
    "xml-entity": "an XML file has a document type declaration or entities",
    "xml-malformed": "an XML file is not well-formed",
    "xml-too-large": "the scene's XML is too long, too rich or takes too long to follow",
    "zip-bomb": "the archive unpacks to more than is allowed, or claims to",
    "zip-encrypted": "an entry is encrypted",
    "zip-malformed": "the archive is damaged",
    "zip-method": "an entry is compressed by a method other than deflate",
}


@dataclass(frozen=True)
class BundleLimits:
    """What one upload may cost before it is refused; each limit is inclusive."""

    #: size of the upload, in bytes
    max_bytes: int = 2 * GIB
    #: entries of the archive, with folders that have no entry of their own
    max_entries: int = 10_000
    #: sum of all entries when unpacked, in bytes
    max_unpacked_bytes: int = 8 * GIB
    #: unpacked over packed size of one entry, where it unpacks to more than `ratio_floor_bytes`,
    #: and of the whole, where that unpacks to more than `total_ratio_floor_bytes`
    max_ratio: float = 200.0
    ratio_floor_bytes: int = MIB
    total_ratio_floor_bytes: int = 64 * MIB
    #: an entry's name, in bytes of UTF-8; one component of it may have 255
    max_name_bytes: int = 1024
    #: folders above an entry
    max_folder_depth: int = 32
    #: XML of the whole scene, in bytes, each include counted every time
    max_xml_bytes: int = 32 * MIB
    #: one tag with its attributes, in bytes
    max_tag_bytes: int = MIB
    #: elements inside one another in one XML file
    max_xml_depth: int = 64
    #: elements of the whole scene, each include counted every time
    max_xml_elements: int = 500_000
    #: parameters of the scene and of the job together
    max_parameters: int = 256
    #: characters of an attribute with parameters, before and after substitution
    max_substituted_characters: int = 2**16
    #: searches for a parameter in attributes with a `$`, one for each 64 characters
    max_substitutions: int = 30_000_000
    #: look-ups in folders for references
    max_lookups: int = 2_000_000
    #: includes inside one another, as in Mitsuba
    max_include_depth: int = 15
    #: includes of the whole scene, each counted every time
    max_includes: int = 1000
    #: different names of files and folders in a scene
    max_references: int = 20_000
    #: sensors and films of the whole scene, each include counted every time
    max_sensors: int = 1000
    #: pixels of the film
    max_pixels: int = 2**26
    #: known types of plugin; empty allows any
    plugins: tuple[str, ...] = ()


def shown(text: str) -> str:
    """Return untrusted text for an error message: quoted, escaped, and not too long."""
    return repr(text) if len(text) <= _MAX_SHOWN else f"{text[:_MAX_SHOWN]!r}…"


def shown_name(name: str) -> str:
    """Return a printable name as it is, and any other quoted and escaped."""
    return name if name.isprintable() and name == name.strip() != "" else repr(name)


def brief(path: str) -> str:
    """Return the end of a path, for messages that name several."""
    return path if len(path) <= _MAX_SHOWN else f"…{path[-_MAX_SHOWN:]}"


class BundleError(FarmError, ValueError):
    """An upload is refused.

    Parameters
    ----------
    code : str
        One of `CODES`, or a format's own: stable, for programs.
    message : str
        What is wrong and what to do, for people.
    file, line : optional
        The file in the bundle that is at fault, and its line, from 1.
    """

    def __init__(
        self, code: str, message: str, *, file: str | None = None, line: int | None = None
    ) -> None:
        if file is not None:
            place = shown_name(file) if line is None else f"{shown_name(file)}, line {line}"
            message = f"{place}: {message}"
        super().__init__(message)
        self.code = code
        self.file = file
        self.line = line

    def to_tell(self) -> dict[str, str | int | None]:
        """Return what `told` takes, for another process."""
        return {"code": self.code, "message": str(self), "file": self.file, "line": self.line}

    @classmethod
    def told(cls, *, code: str, message: str, file: str | None, line: int | None) -> "BundleError":
        """An error that another process reported, with its message unchanged."""
        error = cls(code, message)
        error.file, error.line = file, line
        return error
