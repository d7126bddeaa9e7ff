"""Why an image is black, as far as the scene shows it.

Part of the render child: imports Mitsuba.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any, Final

import drjit as dr
import mitsuba as mi
import numpy as np

NO_EMITTER: Final = 'the scene has no emitter; add one, such as <emitter type="constant"/>'
#: Rays of the camera that are looked at, along each axis of its film.
_RAYS: Final = 8


def why_black(scene: Any, sensor: Any) -> str:
    """Return a note on an image without any light."""
    why = "look whether the emitters are too weak, turned away, or hidden by a shape"
    with suppress(Exception):  # a sensor or a shape of an unusual kind
        if not scene.emitters():
            why = NO_EMITTER
        elif _sees_backs_alone(scene, sensor):
            why = (
                "all that the camera sees are backs of surfaces, which reflect nothing: it may be "
                "inside a shape"
            )
    return f"the image is black, since no light arrived: {why}"


def _sees_backs_alone(scene: Any, sensor: Any) -> bool:
    places = (np.arange(_RAYS) + 0.5) / _RAYS
    x, y = (axis.ravel() for axis in np.meshgrid(places, places))
    if dr.is_jit_v(mi.Float):
        return _of_backs(scene, sensor, mi.Point2f(x, y))
    return all(_of_backs(scene, sensor, mi.Point2f(*place)) for place in zip(x, y, strict=True))


def _of_backs(scene: Any, sensor: Any, places: Any) -> bool:
    ray, _ = sensor.sample_ray(0.0, 0.5, places, mi.Point2f(0.5, 0.5))
    found = scene.ray_intersect(ray)
    if not dr.all(found.is_valid()):
        return False
    flags = mi.BSDFFlags
    lit = int(flags.BackSide) | int(flags.Null) | int(flags.Transmission)
    is_back = dr.dot(found.n, ray.d) > 0
    return bool(dr.all(is_back & ((found.bsdf(ray).flags() & lit) == 0)))
