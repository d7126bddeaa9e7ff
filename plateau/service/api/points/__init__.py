"""Images of points of a curve, made again from slices that a job kept."""

from dataclasses import dataclass


class SliceLost(Exception):
    """A slice is gone or damaged."""


@dataclass(frozen=True)
class KeptSlice:
    """The blob of a slice, and the digest that it must have."""

    blob: str
    sha256: str
