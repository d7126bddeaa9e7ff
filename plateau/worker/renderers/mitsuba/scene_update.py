"""Makes another scene of one that is loaded, where the two differ in a few values alone.

Such are the images of a data set: the camera moves, colours and lights change. Part of the render
child: imports Mitsuba.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import drjit as dr
import mitsuba as mi

from plateau.worker.renderers.contract import Load
from plateau.worker.renderers.mitsuba.scene_prep import PreparedScene, id_of, parsed_nodes

#: The properties of each plugin that can be changed: those that are no part of a kernel. The
#: others may be (a principled BSDF without `metallic` is shorter), or rebuild what a load builds.
_CHANGEABLE: Final[Mapping[str, set[str]]] = {
    "perspective": {"to_world"},
    "thinlens": {"to_world"},
    "diffuse": {"reflectance"},
    "plastic": {"diffuse_reflectance"},
    "roughplastic": {"diffuse_reflectance"},
    "conductor": {"specular_reflectance"},
    "roughconductor": {"specular_reflectance", "alpha"},
    "roughdielectric": {"alpha"},
    "principled": {"base_color", "roughness"},
    "area": {"radiance"},
    "constant": {"radiance"},
    "point": {"intensity"},
    "spot": {"intensity"},
    "directional": {"irradiance"},
}

#: Made in the place of a plugin that takes longer to make, or asks for more; and what is asked for.
_LIKE: Final = {"roughplastic": "plastic", "thinlens": "perspective"}
_NEEDED: Final = {"to_world": {"fov": 45.0}}


class _DifferInMoreError(Exception):
    """The loaded scene cannot become the other."""


def updated(variant: str, one: PreparedScene, request: Load) -> PreparedScene | None:
    """Return the scene of a request that differs from the loaded one's in few values, or None.

    The loaded scene is changed, and is then to the bit what `prepare` would make of the request;
    what was recorded of it holds. After None it is of no use any more; what Mitsuba refuses is
    among that, and a load says why.
    """
    try:
        nodes = parsed_nodes(variant, request)
        if len(nodes) != len(one.nodes):
            return None
        changes = {
            id_of(index, has): _new_values(had.props, has.props)
            for index, (had, has) in enumerate(zip(one.nodes, nodes, strict=True))
            if had != has
        }
        if not changes:  # the same request: its files may have changed
            return None
        objects = {each.id(): each for each in mi.traverse(one.scene).hierarchy}
        for id_, values in changes.items():
            if id_ not in objects:
                return None
            _change(objects[id_], values)
    except (RuntimeError, _DifferInMoreError):
        return None
    return replace(one, nodes=nodes)


def _new_values(had: Any, has: Any) -> dict[str, Any]:
    """Return what differs between two plugins, as `mitsuba.traverse` names it."""
    plugin = has.plugin_name()
    if had.plugin_name() != plugin or set(had.keys()) != set(has.keys()):
        raise _DifferInMoreError
    values: dict[str, Any] = {}
    for name in has.keys():  # noqa: SIM118 - a Mitsuba object, and no mapping
        if dr.all(had[name] == has[name], axis=None):
            continue
        if name not in _CHANGEABLE.get(plugin, ()) or type(had[name]) is not type(has[name]):
            raise _DifferInMoreError
        # Mitsuba says what the value is to the bit.
        made = {"type": _LIKE.get(plugin, plugin), name: has[name], **_NEEDED.get(name, {})}
        parts = mi.traverse(mi.load_dict(made, parallel=False))
        values |= {key: value for key, value in parts if key.split(".")[0] == name}
    return values


def _change(changed: Any, values: Mapping[str, Any]) -> None:
    """Give an object of the loaded scene these values."""
    parts = mi.traverse(changed)
    for key, value in values.items():
        # The spectrum of a light has wavelengths, too.
        if key not in parts or type(parts[key]) is not type(value):
            raise _DifferInMoreError
        dr.make_opaque(value)  # else it would be a part of the kernel
        parts[key] = value
    parts.update()
