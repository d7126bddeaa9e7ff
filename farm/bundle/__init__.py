"""Scenes as they are uploaded: checked without Mitsuba, packed, and unpacked."""

from farm.bundle.check import SceneSummary, inspect_bundle, inspect_each, unpack_bundle
from farm.bundle.plugins import known_plugins
from farm.bundle.rules import CODES, BundleError, BundleLimits

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
