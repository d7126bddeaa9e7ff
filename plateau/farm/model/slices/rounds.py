"""What an image decides of a job that is allocated by zones: its rounds."""

import json
from dataclasses import asdict, dataclass

from plateau.farm.model.slices.zones import Grid, Zone
from plateau.farm.model.spec import SharedSpec
from plateau.farm.model.spec.parts import ZonesAllocation


@dataclass(frozen=True)
class Round:
    """Some slices that an image has decided, until the next point of the curve.

    Attributes
    ----------
    first : int
        Index of the first slice.
    slices : int
        How many there are: a multiple of 4, as they form halves in two ways. 0 ends the plan.
    spp : int
        Samples per pixel of each slice.
    zones : tuple of int or None
        Numbers of zones in the grid, rising; None for the whole film.
    pixels : int
        Pixels of each slice.
    """

    first: int
    slices: int
    spp: int
    zones: tuple[int, ...] | None
    pixels: int

    @property
    def stop(self) -> int:
        """The index after the last slice."""
        return self.first + self.slices

    @property
    def samples(self) -> int:
        """Of all slices."""
        return self.slices * self.spp * self.pixels

    def as_json(self) -> str:
        """Return the round as text: zones as the bits of a number, in hexadecimal."""
        bits = None
        if self.zones is not None:
            chosen = set(self.zones)
            text = "".join(
                "01"[place in chosen] for place in reversed(range(max(chosen, default=0) + 1))
            )
            bits = f"{int(text, 2):x}"
        return json.dumps({**asdict(self), "zones": bits})

    @classmethod
    def from_json(cls, text: str) -> "Round":
        """Return the round that `as_json` wrote."""
        stored = json.loads(text)
        if (zones := stored["zones"]) is not None:
            bits = reversed(f"{int(zones, 16):b}")
            zones = tuple(place for place, bit in enumerate(bits) if bit == "1")
        return cls(**{**stored, "zones": zones})


def slice_zones(
    spec: SharedSpec, one: Round | None, width: int, height: int, border: int
) -> tuple[Zone, ...]:
    """Return the zones of the film that a slice's film has; none for the whole film.

    Parameters
    ----------
    spec, one
        Of the job, and of the slice.
    width, height
        Of the film, in pixels.
    border
        Pixels to which a sample contributes beyond its own. With a border zones lie apart, so that
        the merge can tell their samples from each other's; without one, neighbours are joined.
    """
    if not isinstance(spec.allocation, ZonesAllocation):
        return ()
    grid, numbers = Grid(width, height, spec.allocation.size), None if one is None else one.zones
    if border:
        return grid.zones(numbers)
    return () if numbers is None else grid.joined(numbers)
