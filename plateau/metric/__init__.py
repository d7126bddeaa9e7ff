"""Perception: the light of a screen, visible differences, and when to stop rendering.

Names are imported on first use, so that listing the rules does not import numerics.
The reasons are in docs/decisions/stopping.md.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from plateau.metric.blend import Blend, BlendError, blend_error, blended
    from plateau.metric.display import Image, Mask, View, encode_srgb
    from plateau.metric.estimate import Estimate, allowed_pixels
    from plateau.metric.noise_model import Half, NoiseModel
    from plateau.metric.non_finite import allowed_non_finite, non_finite_pixels
    from plateau.metric.pictures import (
        MAP_PALETTE,
        SAMPLES_PALETTE,
        difference_map,
        heat_map,
        noise_map,
        non_finite_map,
        samples_map,
    )
    from plateau.metric.rules import create_rule
    from plateau.metric.rules.base import Memory, Rule, Verdict
    from plateau.metric.rules.evidence import Evidence
    from plateau.metric.rules.visible import Visible
    from plateau.metric.standard_error import Quarters
    from plateau.metric.vdp import Difference, Percept, VisibleDifferences

__all__ = [
    "MAP_PALETTE",
    "SAMPLES_PALETTE",
    "Blend",
    "BlendError",
    "Difference",
    "Estimate",
    "Evidence",
    "Half",
    "Image",
    "Mask",
    "Memory",
    "NoiseModel",
    "Percept",
    "Quarters",
    "Rule",
    "Verdict",
    "View",
    "Visible",
    "VisibleDifferences",
    "allowed_non_finite",
    "allowed_pixels",
    "blend_error",
    "blended",
    "create_rule",
    "difference_map",
    "encode_srgb",
    "heat_map",
    "noise_map",
    "non_finite_map",
    "non_finite_pixels",
    "samples_map",
]

_HOMES: Final = {
    "blend": ("Blend", "BlendError", "blend_error", "blended"),
    "display": ("Image", "Mask", "View", "encode_srgb"),
    "estimate": ("Estimate", "allowed_pixels"),
    "noise_model": ("Half", "NoiseModel"),
    "non_finite": ("allowed_non_finite", "non_finite_pixels"),
    "pictures": (
        "MAP_PALETTE",
        "SAMPLES_PALETTE",
        "difference_map",
        "heat_map",
        "noise_map",
        "non_finite_map",
        "samples_map",
    ),
    "rules": ("create_rule",),
    "rules.base": ("Memory", "Rule", "Verdict"),
    "rules.evidence": ("Evidence",),
    "rules.visible": ("Visible",),
    "standard_error": ("Quarters",),
    "vdp": ("Difference", "Percept", "VisibleDifferences"),
}
_HOME_OF: Final = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'plateau.metric' has no attribute {name!r}")
    return getattr(import_module(f"plateau.metric.{_HOME_OF[name]}"), name)


def __dir__() -> list[str]:
    return __all__
