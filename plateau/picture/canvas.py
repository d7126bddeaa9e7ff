"""Where a merge adds the zones of a film, and how they make an image.

Under a filter wider than a box, a zone's samples reach into its neighbours. Where zones have
different numbers of samples, a pixel between them would be made of the denser zone's samples above
all, and edges would show. So each zone's sums are kept apart, with its border, and are divided by
its own samples per pixel before they meet. Under a box filter the canvas is the film.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np

from plateau.farm.model.slices.zones import Grid, Zone, pixels_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from plateau.farm.images.channels import Channels
    from plateau.farm.images.exr import Partial


@dataclass(frozen=True)
class Canvas:
    """The sums of all zones of a film, side by side, each with its border.

    Attributes
    ----------
    grid : Grid
        The zones.
    border : int
        Pixels to each side of a zone to which its samples contribute.
    """

    grid: Grid
    border: int

    def about(self) -> dict[str, Any]:
        """Return the canvas for JSON."""
        return {"grid": list(self.grid), "border": self.border}

    @classmethod
    def restored(cls, about: Mapping[str, Any]) -> Canvas:
        """Return the canvas of which `about` told."""
        return cls(Grid(*about["grid"]), about["border"])

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels: without a border, those of the film."""
        grid, both = self.grid, 2 * self.border
        return grid.height + both * grid.rows, grid.width + both * grid.columns

    def parts(
        self, film: NDArray[np.float32], zones: Sequence[Zone]
    ) -> Iterator[tuple[tuple[slice, slice], NDArray[np.float32]]]:
        """Yield the parts of a slice's film: where each goes, and its pixels.

        Parameters
        ----------
        film
            (pixels, channels): zone after zone, each with its border; or (height, width, channels).
        zones
            Its zones; none for the whole film, if zones have no border.

        Raises
        ------
        ValueError
            It has not the pixels of these zones.
        """
        if not zones:
            if self.border or film.shape[:2] != self.shape:
                raise ValueError(f"a film of {film.shape[1]}×{film.shape[0]} pixels is not whole")
            yield (slice(None), slice(None)), film
            return
        blocks = [self._with_border(zone) for zone in zones]
        if film.ndim != 2 or len(film) != pixels_of(blocks):
            raise ValueError(f"a film of {len(film)} pixels has not those of its zones")
        ends = accumulate(block.width * block.height for block in blocks)
        for zone, block, end in zip(zones, blocks, ends, strict=True):
            part = film[end - block.width * block.height : end]
            yield self._place(zone), part.reshape(block.height, block.width, -1)

    def assembled(
        self, total: NDArray[np.float64], spp: NDArray[np.int64], channels: Channels
    ) -> NDArray[np.float64]:
        """Return the sums of the film, of which `Channels` makes an image.

        Parameters
        ----------
        total
            The canvas, with all its channels or the judged ones alone.
        spp
            Samples per pixel of each zone, (rows, columns).
        channels
            Those of the film.
        """
        if not self.border:
            return total  # the weights of a pixel are its own samples'
        film = np.zeros((self.grid.height, self.grid.width, total.shape[-1]))
        planes = map(channels.names.index, channels.ids)
        ids = [plane for plane in planes if plane < total.shape[-1]]
        zones = self.grid.zones()
        for zone, of_zone in zip(zones, spp.ravel(), strict=True):
            x, y, width, height = self._with_border(zone)
            if of_zone:
                film[y : y + height, x : x + width] += total[self._place(zone)] / of_zone
        for zone in zones if ids else ():
            inner = total[self._place(zone)][self._inside(zone)]
            film[zone.y : zone.y + zone.height, zone.x : zone.x + zone.width, ids] = inner[..., ids]
        return film

    def _with_border(self, zone: Zone) -> Zone:
        return zone.with_border(self.border, self.grid.width, self.grid.height)

    def _place(self, zone: Zone) -> tuple[slice, slice]:
        """Return the rows and columns of a zone with its border."""
        row, column = zone.y // self.grid.size, zone.x // self.grid.size
        block = self._with_border(zone)
        top, left = block.y + 2 * self.border * row, block.x + 2 * self.border * column
        return slice(top, top + block.height), slice(left, left + block.width)

    def _inside(self, zone: Zone) -> tuple[slice, slice]:
        """Return the rows and columns of a zone in its own block."""
        block = self._with_border(zone)
        top, left = zone.y - block.y, zone.x - block.x
        return slice(top, top + zone.height), slice(left, left + zone.width)


def areas_of(grid: Grid) -> NDArray[np.int64]:
    """Return how many pixels each zone has, (rows, columns)."""
    rows, columns = (
        np.diff(np.append(np.arange(0, pixels, grid.size), pixels))
        for pixels in (grid.height, grid.width)
    )
    return np.outer(rows, columns).astype(np.int64)


def canvas_of(first: Partial, size: int) -> Canvas:
    """Return the canvas of a job, by the partial of its first slice and the size of its zones."""
    if first.zones:
        width = max(zone.x + zone.width for zone in first.zones)
        height = max(zone.y + zone.height for zone in first.zones)
    else:
        height, width = first.pixels.shape[:2]
    return Canvas(Grid(width, height, size), first.border)


@dataclass(frozen=True)
class Sampled:
    """How many samples the zones on a canvas have.

    Attributes
    ----------
    canvas : Canvas
        The zones.
    spp, even_spp : ndarray, shape (rows, columns), int64
        Samples per pixel: of all slices, and of those with an even index.
    """

    canvas: Canvas
    spp: NDArray[np.int64]
    even_spp: NDArray[np.int64]

    @classmethod
    def none_of(cls, canvas: Canvas) -> Sampled:
        """Return a canvas without samples."""
        shape = canvas.grid.rows, canvas.grid.columns
        return cls(canvas, np.zeros(shape, np.int64), np.zeros(shape, np.int64))

    def note(self, zones: Sequence[Zone], spp: int, *, is_even: bool) -> None:
        """Note a slice of these zones, which are whole; of the whole film, if there are none."""
        film_width, film_height, size = self.canvas.grid
        for x, y, width, height in zones or [Zone(0, 0, film_width, film_height)]:
            rows = slice(y // size, -(-(y + height) // size))
            columns = slice(x // size, -(-(x + width) // size))
            self.spp[rows, columns] += spp
            if is_even:
                self.even_spp[rows, columns] += spp

    def samples(self, spp: NDArray[np.int64]) -> int:
        """Return the samples of the film at these samples per pixel, (rows, columns)."""
        return int((areas_of(self.canvas.grid) * spp).sum())
