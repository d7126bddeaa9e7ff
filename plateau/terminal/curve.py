"""The curve of a job in a terminal, drawn in braille dots.

The noise left falls towards the target, and the changed pixels rise to their plateau. Both are
shares of the image, on one logarithmic axis. Each line has its name at the right, so the colours
carry no information.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from plotille import Canvas
from rich.text import Text

from plateau.farm.model.job import CurvePoint, Job
from plateau.farm.wire import job_text

#: A smaller chart shows nothing; a wider one is hard to read.
LEAST_COLUMNS: Final = 46
LEAST_ROWS: Final = 4
_MOST_COLUMNS: Final = 100
#: Columns beside the dots: for the numbers at the left, and for the names at the right.
_NUMBERS: Final = 8
_NAMES: Final = 12
_NO_DOTS: Final = 0x2800
#: Columns of a dash, and of a dash and its gap.
_DASH: Final = (2, 3)
_NICE: Final = (1, 2, 5, 10)


@dataclass(frozen=True)
class _Line:
    """A line of the chart."""

    name: str
    style: str
    places: list[tuple[float, float]]  #: (spp, share of the image)
    dashed: bool = False


def job_curve(job: Job, points: list[CurvePoint], *, columns: int, rows: int) -> Text:
    """The curve of a job; see `terminal_curve`."""
    return terminal_curve(
        points,
        target=job_text.stop_fraction(job),
        forecast_spp=None if job.state.ended else points[-1].forecast_spp,
        max_spp=job.spec.max_spp,
        columns=columns,
        rows=rows,
    )


def terminal_curve(
    points: list[CurvePoint],
    *,
    target: float | None,
    forecast_spp: int | None,
    max_spp: int,
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
    forecast_spp
        Where the noise left is expected to reach the target.
    max_spp
        The cap, beyond which nothing is drawn.
    columns, rows
        Size of the chart, at least `LEAST_COLUMNS` and `LEAST_ROWS`.
    """
    lines = list(_lines(points, target, forecast_spp, max_spp))
    shares = [share for line in lines for _, share in line.places]
    if not shares:
        return Text("nothing differs visibly, so far", style="dim")
    low, high = _half_decades(min(shares), max(shares))
    end_spp = max(spp for line in lines for spp, _ in line.places)
    chart = _Chart(
        columns=min(columns, _MOST_COLUMNS) - _NUMBERS - _NAMES,
        rows=rows - 1,
        end_spp=max(end_spp, 1.0),
        low=low,
        high=high,
    )
    for line in lines:
        chart.draw(line)
    return chart.text()


def _lines(
    points: list[CurvePoint], target: float | None, forecast_spp: int | None, max_spp: int
) -> Iterator[_Line]:
    """The lines; the most important one comes last and is drawn over the others."""
    changed = [(point.spp, point.visible_fraction) for point in points]
    left = [
        (point.spp, point.estimate_fraction)
        for point in points
        if point.estimate_fraction is not None
    ]
    end = points[-1].spp
    ahead = min(forecast_spp or end, max_spp)
    if target is not None:
        yield _Line("target", "red", [(0.0, target), (max(end, ahead), target)], dashed=True)
    yield _Line("changed", "cyan", _above_zero(changed))
    falling = _above_zero(left)
    if falling and target is not None and ahead > end and falling[-1][1] > target:
        # The error falls as a power of the samples, which is no straight line here. But the end of
        # the dashes answers the question when the noise reaches its target.
        arrival = target if ahead == forecast_spp else falling[-1][1]
        yield _Line("", "magenta", [falling[-1], (ahead, arrival)], dashed=True)
    yield _Line("noise left", "magenta", falling)


class _Chart:
    """Braille dots with numbers and names; each cell has the style of the last line in it."""

    def __init__(self, *, columns: int, rows: int, end_spp: float, low: float, high: float) -> None:
        self._columns, self._rows = columns, rows
        # A margin of one dot, so values on the border are inside.
        self._end_spp = end_spp * (1 + 1 / columns)
        dot = (high - low) / (4 * rows)
        self._low, self._high = low - dot, high + dot
        self._dots = [[_NO_DOTS] * columns for _ in range(rows)]
        self._styles = [[""] * columns for _ in range(rows)]
        self._names: dict[int, tuple[str, str]] = {}

    def draw(self, line: _Line) -> None:
        """Draw a line, and write its name beside its end."""
        canvas = Canvas(
            self._columns,
            self._rows,
            xmin=0,
            xmax=self._end_spp,
            ymin=self._low,
            ymax=self._high,
        )
        places = [(spp, math.log10(share)) for spp, share in line.places]
        if len(places) == 1:
            canvas.point(*places[0])
        for start, end in pairwise(places):
            canvas.line(*start, *end)
        for row, dots in enumerate(canvas.plot(linesep="\n").split("\n")):
            for column, one in enumerate(map(ord, dots)):
                if one != _NO_DOTS and not (line.dashed and column % _DASH[1] >= _DASH[0]):
                    self._dots[row][column] |= one
                    self._styles[row][column] = line.style
        if line.name and places:
            self._name(line.name, line.style, self._row(places[-1][1]))

    def text(self) -> Text:
        """The chart with its axes."""
        text = Text(no_wrap=True, overflow="crop")
        numbers = self._numbers()
        for row in range(self._rows):
            text.append(f"{numbers.get(row, ''):>{_NUMBERS - 2}} ", style="dim")
            text.append("┤" if row in numbers else "│", style="dim")
            for dots, style in zip(self._dots[row], self._styles[row], strict=True):
                text.append(" " if dots == _NO_DOTS else chr(dots), style=style)
            name, style = self._names.get(row, ("", ""))
            text.append(f" {name}\n", style=style)
        text.append(self._axis(), style="dim")
        return text

    def _row(self, log_share: float) -> int:
        height = (log_share - self._low) / (self._high - self._low)
        return self._rows - 1 - round(height * self._rows * 4) // 4  # as the canvas rounds

    def _name(self, name: str, style: str, row: int) -> None:
        """Write a name at its row, or at the nearest free row."""
        free = [one for one in range(self._rows) if one not in self._names]
        if free:
            self._names[min(free, key=lambda one: abs(one - row))] = (name, style)

    def _numbers(self) -> dict[int, str]:
        """The powers of ten, each at its row; every second one if rows are few."""
        powers = range(math.floor(self._high), math.ceil(self._low) - 1, -1)
        every = 1 if len(powers) <= self._rows // 2 else 2
        return {self._row(power): f"{100 * 10.0**power:g} %" for power in powers[::every]}

    def _axis(self) -> str:
        """The axis: round numbers of spp, each below its place."""
        line = [" "] * (_NUMBERS + self._columns)
        step = _round_step(self._end_spp, at_most=max(2, self._columns // 12))
        for number in range(1, int(self._end_spp / step) + 1):
            label = f"{number * step:,.0f}"
            place = _NUMBERS + round(number * step / self._end_spp * (self._columns - 1))
            start = place - len(label) // 2
            line[start : start + len(label)] = label
        return f"{''.join(line)[: _NUMBERS + self._columns + _NAMES - 4]:<{len(line)}} spp"


def _above_zero(places: list[tuple[int, float]]) -> list[tuple[float, float]]:
    """The places that a logarithmic axis can show."""
    return [(float(spp), share) for spp, share in places if share > 0]


def _half_decades(low: float, high: float) -> tuple[float, float]:
    """Exponents of ten around the shares, in steps of a half; the two differ by at least a half."""
    bottom = math.floor(2 * math.log10(low) + 1e-9)
    top = math.ceil(2 * math.log10(high) - 1e-9)
    return bottom / 2, max(top, bottom + 1) / 2


def _round_step(span: float, *, at_most: int) -> float:
    """The smallest round step that fits into the span at most `at_most` times."""
    rough = span / at_most
    decade = 10.0 ** math.floor(math.log10(rough))
    return max(1.0, next(nice * decade for nice in _NICE if nice * decade >= rough * (1 - 1e-9)))
