"""Perception: the light of a screen, visible differences, and when to stop rendering.

Names are imported on first use, so that listing the rules does not import numerics.
The reasons are in docs/decisions/stopping.md.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from plateau.metric.allocation import Allocation, plan_round
    from plateau.metric.blend import Blend, BlendError, Denoise, blend_error, blended
    from plateau.metric.display import Image, Mask, Primaries, View, encode_srgb
    from plateau.metric.estimate import (
        Estimate,
        allowed_pixels,
        estimate_from,
        half_buffer_estimate,
    )
    from plateau.metric.focus import focus_plane
    from plateau.metric.forecasts import Forecast
    from plateau.metric.noise_model import Half, NoiseModel
    from plateau.metric.non_finite import NonFinite, allowed_non_finite, non_finite_pixels
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
    from plateau.metric.rules.base import Json, Memory, Rule, Verdict
    from plateau.metric.rules.evidence import Evidence
    from plateau.metric.rules.fixed import Fixed
    from plateau.metric.rules.jod import Jod
    from plateau.metric.rules.multiple import Multiple
    from plateau.metric.rules.myszkowski import Myszkowski
    from plateau.metric.rules.reverse import Reverse
    from plateau.metric.rules.successive import Successive
    from plateau.metric.rules.visible import Visible
    from plateau.metric.rules.worst import Worst
    from plateau.metric.vdp import Difference, Percept, VisibleDifferences, visible_differences

__all__ = [
    "MAP_PALETTE",
    "SAMPLES_PALETTE",
    "Allocation",
    "Blend",
    "BlendError",
    "Denoise",
    "Difference",
    "Estimate",
    "Evidence",
    "Fixed",
    "Forecast",
    "Half",
    "Image",
    "Jod",
    "Json",
    "Mask",
    "Memory",
    "Multiple",
    "Myszkowski",
    "NoiseModel",
    "NonFinite",
    "Percept",
    "Primaries",
    "Reverse",
    "Rule",
    "Successive",
    "Verdict",
    "View",
    "Visible",
    "VisibleDifferences",
    "Worst",
    "allowed_non_finite",
    "allowed_pixels",
    "blend_error",
    "blended",
    "create_rule",
    "difference_map",
    "encode_srgb",
    "estimate_from",
    "focus_plane",
    "half_buffer_estimate",
    "heat_map",
    "noise_map",
    "non_finite_map",
    "non_finite_pixels",
    "plan_round",
    "samples_map",
    "visible_differences",
]

_HOMES: Final = {
    "allocation": ("Allocation", "plan_round"),
    "blend": ("Blend", "BlendError", "Denoise", "blend_error", "blended"),
    "display": ("Image", "Mask", "Primaries", "View", "encode_srgb"),
    "estimate": ("Estimate", "allowed_pixels", "estimate_from", "half_buffer_estimate"),
    "focus": ("focus_plane",),
    "forecasts": ("Forecast",),
    "noise_model": ("Half", "NoiseModel"),
    "non_finite": ("NonFinite", "allowed_non_finite", "non_finite_pixels"),
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
    "rules.base": ("Json", "Memory", "Rule", "Verdict"),
    "rules.evidence": ("Evidence",),
    "rules.fixed": ("Fixed",),
    "rules.jod": ("Jod",),
    "rules.multiple": ("Multiple",),
    "rules.myszkowski": ("Myszkowski",),
    "rules.reverse": ("Reverse",),
    "rules.successive": ("Successive",),
    "rules.visible": ("Visible",),
    "rules.worst": ("Worst",),
    "vdp": ("Difference", "Percept", "VisibleDifferences", "visible_differences"),
}
_HOME_OF: Final = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'plateau.metric' has no attribute {name!r}")
    return getattr(import_module(f"plateau.metric.{_HOME_OF[name]}"), name)


def __dir__() -> list[str]:
    return __all__
