"""The parts of a film that a slice may have instead of the whole."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable


class Zone(NamedTuple):
    """A rectangle of the film, in pixels from its upper left corner."""

    x: int
    y: int
    width: int
    height: int

    def with_border(self, border: int, film_width: int, film_height: int) -> Zone:
        """Return the zone with as much of a border of so many pixels as lies on the film."""
        left, top = max(0, self.x - border), max(0, self.y - border)
        right = min(film_width, self.x + self.width + border)
        bottom = min(film_height, self.y + self.height + border)
        return Zone(left, top, right - left, bottom - top)


def pixels_of(zones: Iterable[Zone]) -> int:
    """Return how many pixels these zones have together."""
    return sum(zone.width * zone.height for zone in zones)
