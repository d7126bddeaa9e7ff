"""Second opinions: how far an image is from the reference by other metrics of the field.

Both are optional: a run leaves out those that are not installed (`pip install .[opinions]`).

- FLIP (Andersson et al. 2020, doi:10.1145/3406183): mean error, 0 for no difference.
- ColorVideoVDP (Mantiuk et al. 2024, doi:10.1145/3658144): quality in just objectionable
  differences (JOD), 10 for no difference.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

from plateau.metric.display import displayed

if TYPE_CHECKING:
    from collections.abc import Callable

    from plateau.metric import Image, View

#: The module that each metric needs.
_MODULES = {"FLIP": "flip_evaluator", "ColorVideoVDP": "pycvvdp"}


def opinions(reference: Image, test: Image, view: View) -> dict[str, float]:
    """Return the value of each installed metric for a test image."""
    said: dict[str, Callable[[Image, Image, View], float]] = {"FLIP": _flip, "ColorVideoVDP": _jod}
    shown = displayed(reference, view), displayed(test, view)
    return {name: say(*shown, view) for name, say in said.items() if find_spec(_MODULES[name])}


def _pixels_per_degree(image: Image, view: View) -> float:
    return float(image.shape[1] / view.width_deg(image.shape[1]))


def _flip(reference: Image, test: Image, view: View) -> float:
    from flip_evaluator import evaluate

    _, mean, _ = evaluate(
        np.ascontiguousarray(reference),
        np.ascontiguousarray(test),
        "LDR",
        inputsRGB=False,
        applyMagma=False,
        computeMeanError=True,
        parameters={"ppd": _pixels_per_degree(reference, view)},
    )
    return float(mean)


def _jod(reference: Image, test: Image, view: View) -> float:
    import pycvvdp

    display = pycvvdp.vvdp_display_photo_eotf(
        Y_peak=view.white_luminance, contrast=1000, EOTF="linear", E_ambient=0
    )
    geometry = pycvvdp.vvdp_display_geometry(
        [reference.shape[1], reference.shape[0]], ppd=_pixels_per_degree(reference, view)
    )
    metric = pycvvdp.cvvdp(display_photometry=display, display_geometry=geometry, quiet=True)
    # With a linear EOTF it takes cd/m².
    light = (view.white_luminance * shown for shown in (test, reference))
    jod, _ = metric.predict(*light, dim_order="HWC")
    return float(jod)
