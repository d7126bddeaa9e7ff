"""The curve of a job in a terminal, drawn in braille dots.

The noise left falls towards the target, and the changed pixels rise to their plateau. Both are
shares of the image, on one logarithmic axis. Each line has its name at its end, so the colours
carry no information.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from plotille import Figure
from rich.text import Text

from plateau.farm.model.job import CurvePoint
from plateau.farm.wire.figures import percent

#: A smaller chart shows nothing; a wider one is hard to read.
LEAST_COLUMNS: Final = 46
LEAST_ROWS: Final = 7
_MOST_COLUMNS: Final = 100
#: Columns and rows that the axes take, with their numbers.
_AXIS_COLUMNS: Final = 22
_AXIS_ROWS: Final = 3


@dataclass(frozen=True)
class _Line:
    """A line of the chart."""

    name: str
    colour: str
    places: list[tuple[float, float]]  #: (spp, share of the image)


def terminal_curve(
    points: list[CurvePoint],
    *,
    target: float | None,
    columns: int,
    rows: int,
) -> Text:
    """The curve as a text of `rows` lines and at most `columns` columns.

    Parameters
    ----------
    points
        The curve, by rising spp; one at least.
    target
        The noise left at which the job's rule stops, as a share of the image; None if it has none.
    columns, rows
        Size of the chart, at least `LEAST_COLUMNS` and `LEAST_ROWS`.
    """
    lines = list(_lines(points, target))
    shares = [share for line in lines for _, share in line.places]
    if not shares:
        return Text("nothing differs visibly, so far", style="dim")
    end_spp = max(1.0, *(spp for line in lines for spp, _ in line.places))
    figure = Figure()
    figure.width = min(columns, _MOST_COLUMNS) - _AXIS_COLUMNS
    figure.height = rows - _AXIS_ROWS
    figure.linesep = "\n"
    figure.x_label = "spp"
    figure.color_mode = "names"
    figure.x_ticks_fkt = lambda spp, _: f"{spp:,.0f}"
    figure.y_ticks_fkt = lambda power, _: percent(10.0**power)
    low, high = math.log10(min(shares)), math.log10(max(shares))
    margin = 0.05 * (high - low) or 0.25
    figure.set_x_limits(0, end_spp)
    figure.set_y_limits(low - margin, high + margin)
    column = end_spp / figure.width
    for line in lines:
        spps = [spp for spp, _ in line.places]
        powers = [math.log10(share) for _, share in line.places]
        if spps:
            figure.plot(spps, powers, lc=line.colour)
            # That of the target is where no other line comes down to it.
            end = column if line.name == "target" else spps[-1] - len(line.name) * column
            figure.text([max(0.0, end)], [powers[-1]], [line.name], lc=line.colour)
    _, chart = figure.show().split("\n", 1)  # without the arrow above the axis
    return Text.from_ansi(chart, no_wrap=True, overflow="crop")


def _lines(points: list[CurvePoint], target: float | None) -> Iterator[_Line]:
    """The lines; the most important one comes last and is drawn over the others."""
    changed = [(point.spp, point.visible_fraction) for point in points]
    left = [
        (point.spp, point.estimate_fraction)
        for point in points
        if point.estimate_fraction is not None
    ]
    if target is not None:
        yield _Line("target", "red", [(0.0, target), (points[-1].spp, target)])
    yield _Line("changed", "cyan", _above_zero(changed))
    yield _Line("noise left", "magenta", _above_zero(left))


def _above_zero(places: list[tuple[int, float]]) -> list[tuple[float, float]]:
    """The places that a logarithmic axis can show."""
    return [(float(spp), share) for spp, share in places if share > 0]
