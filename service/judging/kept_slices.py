"""Slices that a job has kept, of which an image of its way can be made again."""

from dataclasses import dataclass


class SliceLost(Exception):
    """A slice is gone or spoiled."""


@dataclass(frozen=True)
class KeptSlice:
    """Where a slice lies, and what it has to be."""

    blob: str
    sha256: str
