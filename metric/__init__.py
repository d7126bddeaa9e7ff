"""Perception: what a screen shows, which differences an eye sees, and when to stop rendering."""

from metric.display import Image, Mask, Primaries, View, encode_srgb
from metric.estimate import Estimate, Half, half_buffer_estimate
from metric.pictures import difference_picture
from metric.rules import (
    RULES,
    Evidence,
    Fixed,
    Json,
    Memory,
    Reverse,
    Rule,
    Verdict,
    create_rule,
)
from metric.vdp import Difference, Percept, VisibleDifferences, visible_differences

__all__ = [
    "RULES",
    "Difference",
    "Estimate",
    "Evidence",
    "Fixed",
    "Half",
    "Image",
    "Json",
    "Mask",
    "Memory",
    "Percept",
    "Primaries",
    "Reverse",
    "Rule",
    "Verdict",
    "View",
    "VisibleDifferences",
    "create_rule",
    "difference_picture",
    "encode_srgb",
    "half_buffer_estimate",
    "visible_differences",
]
