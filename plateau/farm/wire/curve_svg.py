"""A curve as an SVG drawing, for a notebook or a file."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Final

from plateau.farm.model.job import CurvePoint, Job
from plateau.farm.model.spec import JobSpec
from plateau.farm.wire import job_text
from plateau.farm.wire.figures import significant

#: The style that a file carries.
STYLE: Final = Path(__file__).with_name("curve.css").read_text("utf-8")

_WIDTH: Final = 760
_LEFT: Final = 70
_RIGHT: Final = 16
_ABOVE: Final = (24, 244)  #: top and bottom of the upper plot
_BELOW: Final = (300, 470)  #: those of the lower one
_VALUES: Final = (526, 666)  #: and of the values of a rule that has its own
_FOOT: Final = 30


@dataclass(frozen=True)
class _Axis:
    """An axis: values from `low` to `high` along pixels from `start` to `end`."""

    low: float
    high: float
    start: float
    end: float
    logarithmic: bool = False

    def at(self, value: float) -> float:
        """The pixel of a value."""
        low, high, value = (
            (math.log10(self.low), math.log10(self.high), math.log10(max(value, self.low)))
            if self.logarithmic
            else (self.low, self.high, value)
        )
        return round(self.start + (self.end - self.start) * (value - low) / (high - low), 1)

    def ticks(self) -> list[float]:
        """Round values along the axis: decades, or about five."""
        if self.logarithmic:
            decades = range(round(math.log10(self.low)), round(math.log10(self.high)) + 1)
            return [10.0**decade for decade in decades]
        step = 10.0 ** math.floor(math.log10((self.high - self.low) / 2))
        step = next(
            size for size in (step, 2 * step, 5 * step) if (self.high - self.low) / size <= 6
        )
        return [n * step for n in range(math.ceil(self.low / step), int(self.high / step) + 1)]


def job_svg(job: Job, points: list[CurvePoint], *, style: str = "") -> str:
    """Draw the curve of a job; see `curve_svg`."""
    pixels = (job.width or 0) * (job.height or 0)
    return curve_svg(job.spec, pixels, points, continued_spp=job.continued_spp, style=style)


def curve_svg(
    spec: JobSpec,
    pixels: int,
    points: list[CurvePoint],
    *,
    continued_spp: int = 0,
    style: str = "",
) -> str:
    """Draw the curve of an image of so many pixels; it has at least one point.

    Changed pixels are above, and the noise left below, on a logarithmic axis; then the values of a
    rule that has its own, such as a quality. A line marks where each rule stopped or would have,
    the job's own beyond the samples with which it began. A page with the drawing has its style, and
    a file needs one inside.
    """
    spp = _Axis(0, points[-1].spp * 1.03, _LEFT, _WIDTH - _RIGHT)
    values = list(_values(spec, points, spp))
    bottom = (_VALUES if values else _BELOW)[1]
    target = (spec.noise_target or 0.0) * pixels
    parts = [
        *_above(points, spp),
        *_below(target, points, spp),
        *values,
        *_stops(spec, points, spp, bottom, continued_spp),
    ]
    inside = f"<style>{style}</style>" if style else ""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {bottom + _FOOT}" '
        f'role="img" aria-label="The curve of the job">{inside}{"".join(parts)}</svg>'
    )


def _above(points: list[CurvePoint], spp: _Axis) -> Iterable[str]:
    most = max(1.0, *(point.visible_pixels for point in points))
    pixels = _Axis(0, 1.1 * most, _ABOVE[1], _ABOVE[0])
    yield from _frame(spp, pixels, "changed since the first image, in pixels")
    yield _line("curve", points, spp, pixels, lambda point: point.visible_pixels)


def _below(target: float, points: list[CurvePoint], spp: _Axis) -> Iterable[str]:
    known = [point for point in points if point.estimate_pixels]
    counts = [point.estimate_pixels or 1.0 for point in known] + ([target] if target else [])
    if not counts:
        return
    low = 10.0 ** math.floor(math.log10(min(counts)) - 0.1)
    high = 10.0 ** math.ceil(math.log10(max(counts)) + 0.05)
    pixels = _Axis(low, high, _BELOW[1], _BELOW[0], logarithmic=True)
    yield from _frame(spp, pixels, "noise left, in pixels, by half buffers")
    banded = [point for point in known if point.estimate_low_pixels and point.estimate_high_pixels]
    if banded:
        edge = [
            *((point.spp, point.estimate_high_pixels or 0.0) for point in banded),
            *((point.spp, point.estimate_low_pixels or 0.0) for point in reversed(banded)),
        ]
        corners = " ".join(f"{spp.at(x)},{pixels.at(y)}" for x, y in edge)
        yield f'<polygon class="band" points="{corners}"/>'
    yield _line("estimate", known, spp, pixels, lambda point: point.estimate_pixels or 0.0)
    if target:
        yield from _target(pixels.at(target), significant(target))


def _values(spec: JobSpec, points: list[CurvePoint], spp: _Axis) -> Iterable[str]:
    rule = job_text.valued_rule(spec)
    if rule is None:
        return
    said = [(point, point.rules.get(rule.name)) for point in points]
    known = {point.spp: one.value for point, one in said if one and one.value is not None}
    if not known:
        return
    shown = [*known.values(), *([] if rule.value_target is None else [rule.value_target])]
    margin = 0.1 * (max(shown) - min(shown)) or 1.0
    axis = _Axis(min(shown) - margin, max(shown) + margin, _VALUES[1], _VALUES[0])
    yield from _frame(spp, axis, f"{rule.quantity}, in {rule.unit}")
    drawn = [point for point in points if point.spp in known]
    yield _line("curve", drawn, spp, axis, lambda point: known[point.spp])
    if rule.value_target is not None:
        yield from _target(axis.at(rule.value_target), f"{rule.value_target:g} {rule.unit}")


def _target(y: float, text: str) -> Iterable[str]:
    yield f'<line class="target" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{y}" y2="{y}"/>'
    yield _text(_WIDTH - _RIGHT, y - 5, f"target {text}", "end", "target")


def _stops(
    spec: JobSpec, points: list[CurvePoint], spp: _Axis, bottom: int, continued_spp: int
) -> Iterable[str]:
    for number, rule in enumerate((spec.rule, *spec.watch)):
        # Another target may have stopped the job that this one goes on with.
        before = 0 if number else continued_spp
        said = ((one.spp, one.rules.get(rule.name)) for one in points if one.spp > before)
        first = next((at for at, value in said if value is not None and value.stop), None)
        if first is None:
            continue
        x, own = spp.at(first), number == 0
        kind = "own stop" if own else "stop"
        yield f'<line class="{kind}" x1="{x}" x2="{x}" y1="{_ABOVE[0]}" y2="{bottom}"/>'
        text = f"{rule.name} {'stops' if own else 'would stop'}"
        side, anchor = (-5, "end") if x > _WIDTH / 2 else (5, "start")
        yield _text(x + side, _ABOVE[0] + 14 + 15 * number, text, anchor)


def _frame(spp: _Axis, pixels: _Axis, title: str) -> Iterable[str]:
    for tick in pixels.ticks():
        y = pixels.at(tick)
        yield f'<line class="grid" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{y}" y2="{y}"/>'
        yield _text(_LEFT - 8, y + 4, f"{tick:,.6g}", "end")
    for tick in spp.ticks():
        x = spp.at(tick)
        yield f'<line class="grid" x1="{x}" x2="{x}" y1="{pixels.end}" y2="{pixels.start}"/>'
        yield _text(x, pixels.start + 18, f"{tick:,.6g}", "middle")
    yield _text(_LEFT, pixels.end - 8, title, "start", "title")


def _line(
    kind: str,
    points: list[CurvePoint],
    spp: _Axis,
    pixels: _Axis,
    value: Callable[[CurvePoint], float],
) -> str:
    places = [(spp.at(point.spp), pixels.at(value(point))) for point in points]
    line = " ".join(f"{x},{y}" for x, y in places)
    dots = "".join(f'<circle cx="{x}" cy="{y}" r="3"/>' for x, y in places)
    return f'<g class="{kind}"><polyline points="{line}"/>{dots}</g>'


def _text(x: float, y: float, text: str, anchor: str, kind: str = "") -> str:
    return f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" class="{kind}">{escape(text)}</text>'
