"""Open Image Denoise: a denoiser for rendered images, by a neural network, on the CPU."""

from __future__ import annotations

import platform
from functools import cache
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from plateau.metric import Image, View
    from plateau.metric.blend import Denoise

#: What says how to get it.
MISSING: Final = "Open Image Denoise is not installed here: install plateau[denoise]"


def is_installed() -> bool:
    """Return whether this Python has Open Image Denoise."""
    return find_spec("mitsuba_oidn") is not None


def version() -> str:
    """Return its version; ImportError where it cannot be used."""
    try:
        import mitsuba_oidn
    except RuntimeError as error:  # a library of the system that Dr.Jit needs is missing
        raise ImportError(str(error)) from error
    found: str = mitsuba_oidn.oidn_version()
    return found


@cache
def _cpu() -> Any:
    """Return the CPU. Unless asked, the library takes a GPU where there is one: other bits."""
    import mitsuba_oidn as oidn

    return oidn.Device(oidn.DeviceType.CPU)


def denoiser(guides: Sequence[Image], view: View, gain: float = 1.0) -> tuple[Denoise, str]:
    """Return the denoiser for images with these guides, and what it is in words.

    Parameters
    ----------
    guides
        Albedo and shading normal, (H, W, 3) float32, taken as free of noise, NaN as 0; or none.
    view
        The display. Its exposure scales the image for the network, which would otherwise look for
        one itself, in another way on another number of threads.
    gain
        By what its scene brightens the image beside that.
    """
    import mitsuba_oidn as oidn

    scale = float(np.clip(gain / view.brightest, 1e-30, 1e30))
    auxiliary = {}
    if guides:
        albedo, normal = (np.nan_to_num(np.ascontiguousarray(one, np.float32)) for one in guides)
        auxiliary = {"albedo": albedo.clip(0, 1), "normal": normal.clip(-1, 1)}

    def denoise(image: Image) -> Image:
        found: Image = oidn.denoise(
            np.ascontiguousarray(image, np.float32),
            hdr=True,
            clean_aux=bool(guides),
            input_scale=scale,
            device=_cpu(),
            **auxiliary,
        )
        return np.array(found, np.float32)

    words = f"Open Image Denoise {version()}, input scale {scale:g}"
    words += ", albedo and normal" if guides else ", no guides"
    return denoise, f"{words}, {platform.machine()}"
