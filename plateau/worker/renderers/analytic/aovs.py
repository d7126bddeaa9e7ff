"""The geometry of an analytic scene: what its AOVs and its alpha are.

Every scene is one plane that leans away from the camera, cut into 3 × 3 rectangles (its shapes), of
two triangles each (their primitives).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from plateau.farm.model.aovs import AovName

Array: TypeAlias = "NDArray[np.float64]"

#: The lower edge of the plane is this far from the camera, and the upper one twice as far.
_NEAREST: Final = 2.0
_RECTANGLES: Final = 3  #: along each side


def alpha(width: int, height: int) -> Array:
    """Return how much the plane covers of each pixel: 1 in the middle, then 0.5, and 0."""
    x, y = pixel_centres(width, height)
    off_centre = 2 * np.maximum(np.abs(x - 0.5), np.abs(y - 0.5))
    return np.where(off_centre < 0.6, 1.0, np.where(off_centre < 0.8, 0.5, 0.0))


def pixel_centres(width: int, height: int) -> tuple[Array, Array]:
    """Return the centres of the pixels, of the film's size: x to the right, y down."""
    y, x = np.mgrid[0:height, 0:width]
    return (x + 0.5) / width, (y + 0.5) / height


def _albedo(_x: Array, _y: Array, light: Array) -> Array:
    """The light over white: the plane is lit evenly."""
    return np.minimum(light, 1)


def _normal(x: Array, _y: Array, _light: Array) -> Array:
    length = np.hypot(1, _NEAREST)
    return np.broadcast_to([0.0, _NEAREST / length, 1 / length], (*x.shape, 3))


def _depth(_x: Array, y: Array, _light: Array) -> Array:
    return (_NEAREST * (2 - y))[..., None]


def _position(x: Array, y: Array, light: Array) -> Array:
    return np.concatenate([np.stack([x, 1 - y], axis=-1), -_depth(x, y, light)], axis=-1)


def _uv(x: Array, y: Array, _light: Array) -> Array:
    return np.stack([x, 1 - y], axis=-1)


def _shape_id(x: Array, y: Array, _light: Array) -> Array:
    column, row = (np.minimum(np.floor(_RECTANGLES * at), _RECTANGLES - 1) for at in (x, y))
    return (1 + _RECTANGLES * row + column)[..., None]


def _primitive_id(x: Array, y: Array, _light: Array) -> Array:
    across, down = (_RECTANGLES * at % 1 for at in (x, y))
    return (across < down).astype(np.float64)[..., None]


#: The values of each AOV, (height, width, channels), at points of the film, where the light is so.
GEOMETRY: Final[Mapping[AovName, Callable[[Array, Array, Array], Array]]] = {
    "albedo": _albedo,
    "normal": _normal,
    "depth": _depth,
    "position": _position,
    "uv": _uv,
    "shape_id": _shape_id,
    "primitive_id": _primitive_id,
}
