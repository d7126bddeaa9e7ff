"""The film of a pass while the chunks that the kernel renders come in."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from plateau.farm.model.slices.zones import Zone

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from plateau.worker.renderers.mitsuba.scene_prep import PreparedScene


class Band(NamedTuple):
    """Whole rows of a zone, of which `top` is the film's row."""

    zone: int
    top: int
    rows: int


class PassFilm:
    """The film of a pass.

    Parameters
    ----------
    one : PreparedScene
        The scene that is rendered.
    border : int
        Pixels to each side to which a sample contributes beyond its own.
    zones : sequence of Zone
        The parts of the film that are rendered; none for the whole film.
    """

    def __init__(self, one: PreparedScene, border: int, zones: Sequence[Zone]) -> None:
        self._one, self._border = one, border
        self._whole_film = not zones
        self._zones = zones or [Zone(0, 0, one.width, one.height)]
        # What a filter's taps give is rounded to float32 once, when all is added.
        kind = np.float64 if border else np.float32
        self._films = [
            np.zeros((h + 2 * border, w + 2 * border, len(one.channels.names)), kind)
            for _, _, w, h in self._zones
        ]
        self._to_begin = [Band(zone, y, h) for zone, (_, y, _, h) in enumerate(self._zones)]
        self._rows_to_add = sum(h for _, _, _, h in self._zones)

    @property
    def is_begun(self) -> bool:
        """Whether all rows were handed out."""
        return not self._to_begin

    @property
    def is_whole(self) -> bool:
        """Whether all rows were added."""
        return self._rows_to_add == 0

    def next_bands(self, most: int) -> list[Band]:
        """Hand out the next rows, of `most` pixels or fewer, so that all chunks are of one size.

        A row of each zone is the least. A small last chunk would cost the time between two chunks.
        """
        left = sum(rows * self._zones[zone][2] for zone, _, rows in self._to_begin)
        pixels = -(-left // -(-left // max(1, most)))
        bands: list[Band] = []
        while self._to_begin and (pixels > 0 or not bands):
            zone, top, rows = self._to_begin.pop(0)
            width = self._zones[zone][2]
            taken = min(rows, max(1, pixels // width))
            bands.append(Band(zone, top, taken))
            pixels -= taken * width
            if taken < rows:
                self._to_begin.insert(0, Band(zone, top + taken, rows - taken))
        return bands

    def pixels(self, bands: list[Band]) -> NDArray[np.uint32]:
        """Return the numbers of these bands' pixels, counted along the rows of the film."""
        numbers = []
        for zone, top, rows in bands:
            x, _, width, _ = self._zones[zone]
            row = np.arange(x, x + width, dtype=np.uint32)
            starts = np.arange(top, top + rows, dtype=np.uint32) * np.uint32(self._one.width)
            numbers.append((starts[:, None] + row).ravel())
        return np.concatenate(numbers)

    def add(
        self,
        bands: list[Band],
        sums: list[list[NDArray[np.float32]]],
        ids: list[NDArray[np.float32]],
    ) -> None:
        """Add what the samples of these bands give.

        Parameters
        ----------
        bands : list of Band
            As `next_bands` handed them out.
        sums : list of list of ndarray
            For each tap of the filter, row by row from the upper left, the values of each summed
            channel, one a pixel.
        ids : list of ndarray
            The values of each id.
        """
        border = self._border
        taps = 2 * border + 1
        start = 0
        for zone, top, rows in bands:
            _, y, width, _ = self._zones[zone]
            film, first = self._films[zone], top - y
            end = start + rows * width
            # A row's share comes before that of the next, whichever chunk they are in.
            for down in reversed(range(taps)):
                for across in range(taps):
                    there = film[first + down : first + down + rows, across : across + width]
                    tap = sums[down * taps + across]
                    for channel, values in zip(self._one.channels.summed, tap, strict=True):
                        there[..., channel] += values[start:end].reshape(rows, width)
            here = film[first + border : first + border + rows, border : border + width]
            for channel, values in zip(self._one.channels.of_ids, ids, strict=True):
                here[..., channel] = values[start:end].reshape(rows, width)
            start = end
            self._rows_to_add -= rows

    def pixels_of_zones(self) -> NDArray[np.float32]:
        """Return the film.

        Returns
        -------
        ndarray, float32
            Of the whole film (height, width, channels). Of zones (pixels, channels): zone after
            zone, each row by row, with as much of its border as lies on the film.
        """
        shown = []
        for film, zone in zip(self._films, self._zones, strict=True):
            margin = 0 if self._whole_film else self._border
            x, y, w, h = zone.with_border(margin, self._one.width, self._one.height)
            left, top = x - zone.x + self._border, y - zone.y + self._border
            shown.append(film[top : top + h, left : left + w].astype(np.float32, copy=False))
        if self._whole_film:
            return shown[0]
        return np.concatenate([part.reshape(-1, part.shape[-1]) for part in shown])
