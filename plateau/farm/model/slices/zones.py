"""The parts of a film that a slice may have instead of the whole."""

from collections.abc import Iterable
from functools import lru_cache
from itertools import groupby
from typing import NamedTuple


class Zone(NamedTuple):
    """A rectangle of the film, in pixels from its upper left corner."""

    x: int
    y: int
    width: int
    height: int

    def with_border(self, border: int, film_width: int, film_height: int) -> "Zone":
        """Return the zone with as much of a border of so many pixels as lies on the film."""
        left, top = max(0, self.x - border), max(0, self.y - border)
        right = min(film_width, self.x + self.width + border)
        bottom = min(film_height, self.y + self.height + border)
        return Zone(left, top, right - left, bottom - top)


class Grid(NamedTuple):
    """A film, divided into square zones, numbered by rows; the last may be smaller.

    Attributes
    ----------
    width, height : int
        Of the film, in pixels.
    size : int
        Of a zone, in pixels.
    """

    width: int
    height: int
    size: int

    @property
    def columns(self) -> int:
        """The number of zones in a row."""
        return -(-self.width // self.size)

    @property
    def rows(self) -> int:
        """The number of rows of zones."""
        return -(-self.height // self.size)

    def zone(self, number: int) -> Zone:
        """Return the zone of this number."""
        y, x = (place * self.size for place in divmod(number, self.columns))
        return Zone(x, y, min(self.size, self.width - x), min(self.size, self.height - y))

    def zones(self, numbers: Iterable[int] | None = None) -> tuple[Zone, ...]:
        """Return these zones, or all of them."""
        return _all_zones(self) if numbers is None else tuple(map(self.zone, numbers))

    def joined(self, numbers: Iterable[int]) -> tuple[Zone, ...]:
        """Return rectangles that cover these zones: neighbours in a row are one.

        `numbers` rise.

        Examples
        --------
        >>> Grid(80, 64, 32).joined([0, 1, 4])
        (Zone(x=0, y=0, width=64, height=32), Zone(x=32, y=32, width=32, height=32))
        """

        def run_of(one: tuple[int, int]) -> tuple[int, int]:
            place, number = one
            return number // self.columns, number - place

        runs = []
        for _, run in groupby(enumerate(numbers), run_of):
            zones = [self.zone(number) for _, number in run]
            first, last = zones[0], zones[-1]
            runs.append(Zone(first.x, first.y, last.x + last.width - first.x, first.height))
        return tuple(runs)


@lru_cache(maxsize=8)
def _all_zones(grid: Grid) -> tuple[Zone, ...]:
    return tuple(map(grid.zone, range(grid.rows * grid.columns)))


def pixels_of(zones: Iterable[Zone]) -> int:
    """Return how many pixels these zones have together."""
    return sum(zone.width * zone.height for zone in zones)
