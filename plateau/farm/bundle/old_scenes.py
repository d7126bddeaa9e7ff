"""Scenes for Mitsuba 0.6 and older: what Mitsuba 3 does not take over by itself.

It does rename properties (``maxDepth``) and some plugins' parameters of such a scene. All that is
here was tried with Mitsuba 3.9.1.
"""

import re
from collections.abc import Collection, Mapping
from typing import Final

from plateau.farm.bundle.limits import BundleError, shown
from plateau.farm.bundle.plugins import WAS

_MOST_LISTED: Final = 12
_OLD: Final = re.compile(r"\s*[01]\.")
#: The sun stands over the axis +z now, and stood over +y.
_SKIES: Final = ("sky", "sun", "sunsky")
_UP: Final = '<rotate x="1" angle="-90"/> in its to_world, since its up is +z now, and was +y'

_TAGS: Final = {
    "lookAt": "write <lookat>",
    "luminaire": "write <emitter>",
    "camera": "write <sensor>",
    "srgb": "write <rgb> with three numbers",
    "blackbody": 'write <spectrum type="blackbody"> with a <float name="temperature">',
    "subsurface": "use a <medium> and the integrator volpath",
    "animation": "use one <transform>",
}
_PLAIN: Final = ("boolean", "float", "integer", "string")
#: Properties that Mitsuba 3 refuses.
_GONE: Final = (
    *("attachlog", "burn", "exposure", "gamma", "highqualityedges", "key", "strictnormals"),
    *("sunradiusscale", "tonemappingmethod"),
)


class OldScene:
    """What has to be changed in a scene, as far as its files are for an old Mitsuba."""

    def __init__(self, plugins: Collection[str]) -> None:
        self._plugins = plugins
        self._version = ""
        self._listed: list[str] = []
        self._count = 0
        self._at: tuple[str, int] | None = None

    def is_old(self, version: str) -> bool:
        """Return whether a file of this version is for an old Mitsuba."""
        if not _OLD.match(version):
            return False
        self._version = version
        return True

    def meet(self, tag: str, attributes: Mapping[str, str], file: str, line: int) -> bool:
        """Return whether an element has to be changed."""
        plugin, name = attributes.get("type", ""), attributes.get("name", "")
        value = attributes.get("value", "")
        if tag in _TAGS:
            what, to_do = f"<{tag}>", _TAGS[tag]
        elif plugin not in self._plugins and (plugin in WAS or (plugin and self._plugins)):
            use = f"use {WAS[plugin]}" if plugin in WAS else "Mitsuba 3 has no such plugin"
            what, to_do = shown(plugin), use
        elif tag == "spectrum" and ":" not in value and len(re.split(r"[\s,]+", value.strip())) > 1:
            what, to_do = "<spectrum> with three numbers", "write <rgb>"
        elif tag == "spectrum" and {"intent", "temperature"} & attributes.keys():
            what, to_do = "<spectrum intent= or temperature=>", "Mitsuba 3 has no such attribute"
        elif tag == "rgb" and value.startswith("#"):
            what, to_do = shown(value), "write three numbers"
        elif tag in _PLAIN and name.replace("_", "").lower() in _GONE:
            what, to_do = shown(name), "delete it"
        else:
            return False
        self._note(what, to_do, file, line)
        return True

    def without_up(self, plugin: str, file: str, line: int) -> None:
        """Note an emitter that no transform turns, if it is a sky."""
        if plugin in _SKIES:
            self._note(plugin, f"put {_UP}", file, line)

    def _note(self, what: str, to_do: str, file: str, line: int) -> None:
        self._at = self._at or (file, line)
        where = f"line {line}" if file == self._at[0] else f"{file}, line {line}"
        self._count += 1
        if self._count <= _MOST_LISTED:
            self._listed.append(f"{where}, {what}: {to_do}")

    def check(self) -> None:
        """Refuse the scene if anything in it has to be changed; lists it by its lines."""
        if self._at is None:
            return
        more = self._count - len(self._listed)
        raise BundleError(
            "old-scene",
            f"the scene is for Mitsuba {shown(self._version)}, and is rendered with Mitsuba 3. "
            f"Mitsuba renames most of what is old by itself. Change: {'; '.join(self._listed)}"
            + (f"; and {more} more" if more > 0 else ""),
            file=self._at[0],
            line=self._at[1],
        )
