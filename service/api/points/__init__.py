"""Images of points of a curve, made again from slices that a job kept."""

from dataclasses import dataclass


class SliceLost(Exception):
    """A slice is gone or spoiled."""


@dataclass(frozen=True)
class KeptSlice:
    """Where a slice lies, and what it has to be."""

    blob: str
    sha256: str
