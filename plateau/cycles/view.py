"""The view transform of a Blender scene, baked by Blender itself."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plateau.cycles.blender import blender, bpy
from plateau.farm.images.png import decode_png
from plateau.farm.images.view_transform import SIZE, ViewTransform, lattice

if TYPE_CHECKING:
    from numpy.typing import NDArray

_DISPLAY: Final = "sRGB"
_AS_IT_IS: Final = ("Standard", "None", 0.0, 1.0)
#: Steps of colour, between which a table would interpolate.
_FALSE_COLOUR: Final = "False Color"


def baked(scene: Any) -> ViewTransform | None:
    """Return the scene's view transform, look, exposure, gamma, curves and white balance.

    Returns
    -------
    ViewTransform or None
        None where the image is seen as it is, by sRGB's curve.

    Raises
    ------
    SceneError
        The scene's view transform has no sRGB display.
    """
    view = scene.view_settings
    with blender():
        _show_on_srgb(scene)
    plain = (view.view_transform, view.look, view.exposure, view.gamma)
    is_changed = view.use_curve_mapping or view.use_white_balance
    if view.view_transform == _FALSE_COLOUR or (plain == _AS_IT_IS and not is_changed):
        return None
    gain = float(2.0**view.exposure)
    axis = lattice(gain)
    red, green, blue = np.meshgrid(axis, axis, axis, indexing="ij")
    light = np.stack([red, green, blue, np.ones_like(red)], axis=-1).astype(np.float32)
    codes = _through(scene, light.reshape(SIZE * SIZE, SIZE, 4))
    table = np.rint(codes * 65535).astype(np.uint16)
    return ViewTransform(table.reshape(SIZE, SIZE, SIZE, 3), gain)


def described(scene: Any) -> str:
    """Return the scene's view transform in words."""
    view = scene.view_settings
    looks = "" if view.look == "None" else f", look {view.look}"
    exposure = f", {view.exposure:+.3g} EV" if view.exposure else ""
    return f"{view.view_transform}{looks}{exposure}"


def _show_on_srgb(scene: Any) -> None:
    """Have the scene shown on an sRGB display; one transform may not exist there."""
    if scene.display_settings.display_device != _DISPLAY:
        wanted = scene.view_settings.view_transform
        scene.display_settings.display_device = _DISPLAY
        try:
            scene.view_settings.view_transform = wanted
        except TypeError as error:
            raise RuntimeError(f"the view transform {wanted} has no {_DISPLAY} display") from error


def _through(scene: Any, light: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what Blender saves of an image with 16 bits, (height, width, 3) from 0 to 1."""
    height, width, _ = light.shape
    image = bpy.data.images.new("light", width, height, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    image.pixels.foreach_set(light[::-1].ravel())  # from the lowest row up
    written = scene.render.image_settings
    written.media_type, written.file_format = "IMAGE", "PNG"
    written.color_mode, written.color_depth = "RGB", "16"
    written.color_management = "FOLLOW_SCENE"
    scene.render.dither_intensity = 0.0
    file = os.memfd_create("look")
    try:
        with blender():
            image.save_render(f"/proc/self/fd/{file}", scene=scene)
        content = os.pread(file, os.fstat(file).st_size, 0)
    finally:
        os.close(file)
        bpy.data.images.remove(image)
    return decode_png(content).colour
