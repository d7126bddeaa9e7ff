"""Perception: the light of a screen, visible differences, and when to stop rendering.

Names are imported on first use, so that listing the rules does not import numerics.
The reasons are in docs/decisions/stopping.md.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from plateau.metric.blend import blended
    from plateau.metric.display import Image, Mask, View, encode_srgb
    from plateau.metric.estimate import Estimate
    from plateau.metric.noise_model import Half, NoiseModel
    from plateau.metric.rules import create_rule
    from plateau.metric.rules.base import Rule, Verdict
    from plateau.metric.rules.evidence import Evidence
    from plateau.metric.rules.visible import Visible
    from plateau.metric.vdp import Percept, VisibleDifferences

__all__ = [
    "Estimate",
    "Evidence",
    "Half",
    "Image",
    "Mask",
    "NoiseModel",
    "Percept",
    "Rule",
    "Verdict",
    "View",
    "Visible",
    "VisibleDifferences",
    "blended",
    "create_rule",
    "encode_srgb",
]

_HOMES: Final = {
    "blend": ("blended",),
    "display": ("Image", "Mask", "View", "encode_srgb"),
    "estimate": ("Estimate",),
    "noise_model": ("Half", "NoiseModel"),
    "rules": ("create_rule",),
    "rules.base": ("Rule", "Verdict"),
    "rules.evidence": ("Evidence",),
    "rules.visible": ("Visible",),
    "vdp": ("Percept", "VisibleDifferences"),
}
_HOME_OF: Final = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'plateau.metric' has no attribute {name!r}")
    return getattr(import_module(f"plateau.metric.{_HOME_OF[name]}"), name)


def __dir__() -> list[str]:
    return __all__
