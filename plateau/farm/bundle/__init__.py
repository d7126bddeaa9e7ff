"""Uploaded scenes: checked without Mitsuba, and unpacked."""

from plateau.farm.bundle.check import SceneSummary, inspect_bundle, inspect_each, unpack_bundle
from plateau.farm.bundle.limits import CODES, BundleError, BundleLimits
from plateau.farm.bundle.plugins import known_plugins

__all__ = [
    "CODES",
    "BundleError",
    "BundleLimits",
    "SceneSummary",
    "inspect_bundle",
    "inspect_each",
    "known_plugins",
    "unpack_bundle",
]
