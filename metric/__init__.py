"""Perception: what a screen shows, which differences an eye sees, and when to stop rendering.

The reasons are in docs/decisions/metric.md.
"""

from plateau.metric.display import Image, Mask, Primaries, View, encode_srgb
from plateau.metric.estimate import Estimate, half_buffer_estimate
from plateau.metric.forecasts import Forecast, forecast
from plateau.metric.noise_model import Half
from plateau.metric.non_finite import NonFinite, allowed_non_finite, non_finite_pixels
from plateau.metric.pictures import MAP_PALETTE, difference_map, non_finite_map
from plateau.metric.rules import (
    RULES,
    Evidence,
    Fixed,
    Json,
    Memory,
    Multiple,
    Myszkowski,
    Reverse,
    Rule,
    Successive,
    Verdict,
    Visible,
    create_rule,
)
from plateau.metric.vdp import Difference, Percept, VisibleDifferences, visible_differences
from plateau.metric.zones import zone_edges, zone_fractions

__all__ = [
    "MAP_PALETTE",
    "RULES",
    "Difference",
    "Estimate",
    "Evidence",
    "Fixed",
    "Forecast",
    "Half",
    "Image",
    "Json",
    "Mask",
    "Memory",
    "Multiple",
    "Myszkowski",
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
    "allowed_non_finite",
    "create_rule",
    "difference_map",
    "encode_srgb",
    "forecast",
    "half_buffer_estimate",
    "non_finite_map",
    "non_finite_pixels",
    "visible_differences",
    "zone_edges",
    "zone_fractions",
]
