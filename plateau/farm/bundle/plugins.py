"""Mitsuba's types of plugin, found without running it."""

import difflib
import importlib.util
from collections.abc import Iterable
from pathlib import Path
from typing import Final

#: Integrators for differentiable rendering, written in Python; the others are a library each.
_IN_PYTHON: Final = (
    *("direct_projective", "prb", "prb_basic", "prb_projective", "prbvolpath"),
    "volprim_rf_basic",
)

#: Plugins of Mitsuba 0.6 that went, and what does their work.
WAS: Final = {
    old: new
    for new, gone in {
        "hdrfilm": ("ldrfilm", "mfilm", "tiledhdrfilm"),
        "independent": ("halton", "hammersley", "sobol"),
        "path": ("adaptive", "bdpt", "erpt", "irrcache", "mlt", "photonmapper", "ppm", "pssmlt"),
        "volpath": ("volpath_simple", "dipole", "singlescatter"),
        "aov": ("field", "multichannel"),
        "principled": ("phong", "ward", "coating", "roughcoating", "irawan", "difftrans"),
        "blendbsdf": ("mixturebsdf",),
        "diffuse": ("roughdiffuse",),
        "sunsky": ("sky", "sun"),
        "directionalarea": ("collimated",),
        "perspective": ("perspective_rdist", "spherical", "telecentric"),
        "checkerboard": ("gridtexture",),
        "mesh_attribute": ("vertexcolors",),
        "ply": ("heightfield", "deformable"),
        "gridvolume": ("hgridvolume",),
        "sggx": ("kkay", "microflake"),
    }.items()
    for old in gone
}
#: Longer than the name of any plugin; a search for similar names takes time.
_LONGEST_PLUGIN: Final = 40


def known_plugins(more: Iterable[str] = ()) -> tuple[str, ...]:
    """Return the installed Mitsuba's types of plugin, and `more`, sorted; empty without Mitsuba."""
    mitsuba = importlib.util.find_spec("mitsuba")  # which does not import it
    if mitsuba is None or mitsuba.origin is None:
        return ()
    libraries = Path(mitsuba.origin).with_name("plugins").glob("*.*")
    return tuple(sorted({*(path.stem for path in libraries), *_IN_PYTHON, *more}))


def guess(plugin: str, known: Iterable[str]) -> str:
    """Return a phrase with the known plugin whose name is most like this one; "" if none is."""
    if plugin in WAS and WAS[plugin] in known:
        return f"; it is one of Mitsuba 0.6: use {WAS[plugin]!r}"
    nearest = difflib.get_close_matches(plugin[:_LONGEST_PLUGIN], known, n=1)
    return f"; did you mean {nearest[0]!r}?" if nearest else ""
