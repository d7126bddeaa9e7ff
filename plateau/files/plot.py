"""The curve as a picture: the changed pixels and the noise left, over spp."""

import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from plateau.farm.model.job import CurvePoint, Job
from plateau.farm.wire import job_text
from plateau.farm.wire.figures import share, significant
from plateau.rules import StoppingRule

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CURVE: Final = "#1f6f8b"
_LINE: Final = "#d1495b"
_ESTIMATE: Final = "#6b4e9b"
_STOP: Final = "#5a5a5a"
_DPI: Final = 150
_SMALL: Final = 9  #: points
_SMALLEST: Final = 8
#: Margins for the labels, in shares of the figure, since a layout that measures the text draws
#: everything three times. Numbers of pixels have up to ten digits and commas.
_MARGINS: Final = {"left": 0.115, "right": 0.89, "bottom": 0.09, "top": 0.9, "hspace": 0.2}
#: Letters of a title that always fit, and letters of the name that are never cut.
_MOST_LETTERS: Final = 64
_LEAST_LETTERS: Final = 8


@dataclass(frozen=True, kw_only=True)
class Marks:
    """The marks of the rules in a picture of a curve."""

    window: int  #: number of points of the regression line
    stop_slope: float | None  #: the slope at which the job stops, in pixels per spp of this image
    target: float | None  #: the noise left at which the job stops, as a share of the pixels
    stops: Mapping[str, int]  #: by label: the spp of a vertical line
    valued: StoppingRule | None = None  #: a rule with values of its own, which are a third plot


def import_ahead() -> None:
    """Import Matplotlib in a thread, while the caller waits for something else."""

    def load() -> None:
        with suppress(ModuleNotFoundError):  # `plot_job` will report it
            import_module("matplotlib.figure")

    threading.Thread(target=load, name="imports", daemon=True).start()


def plot_job(job: Job, points: list[CurvePoint], path: Path) -> None:
    """Write the curve of a job as a PNG file; see `plot_curve`."""
    plot_curve(
        job.name,
        _outcome(job),
        points,
        path,
        Marks(
            window=job_text.slope_limit(job.spec).window,
            stop_slope=job_text.stop_slope(job),
            target=job_text.stop_fraction(job),
            stops={"": job.spp} if job.state.ended else {},
            valued=job_text.valued_rule(job.spec),
        ),
    )


def plot_curve(name: str, outcome: str, points: list[CurvePoint], path: Path, marks: Marks) -> None:
    """Write a curve as a PNG file of 1200 × 900 pixels; see `curve_figure`."""
    curve_figure(name, outcome, points, marks).savefig(path, dpi=_DPI)


def curve_figure(name: str, outcome: str, points: list[CurvePoint], marks: Marks) -> "Figure":
    """A curve, by rising spp, as a figure with the title `name: outcome`; a long name is cut.

    The upper plot shows the pixels that have changed since the first image, the regression line
    over the last window, and its slope. The lower plot shows the noise left and its band on a
    logarithmic axis. A third one shows the values of a rule that has its own, such as a quality.
    All labels are above the plots, so they hide no data.
    """
    # Matplotlib takes a second to import.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 6))
    FigureCanvasAgg(figure)
    ratios = (3, 2) if marks.valued is None else (3, 2, 2)
    plots = figure.subplots(
        len(ratios), 1, sharex=True, height_ratios=ratios, gridspec_kw=_MARGINS
    ).tolist()
    room = max(_LEAST_LETTERS, _MOST_LETTERS - len(outcome))
    cut = name if len(name) <= room else f"{name[: room - 1]}…"
    figure.suptitle(f"{cut}: {outcome}", x=0.01, ha="left", fontweight="bold")
    _draw_changed(plots[0], points, marks)
    _draw_noise_left(plots[1], points, marks.target)
    if marks.valued is not None:
        _draw_values(plots[2], points, marks.valued)
    plots[-1].set_xlabel("samples per pixel (spp)")
    plots[-1].xaxis.set_major_formatter(lambda value, _: f"{value:,.12g}")
    for axes in plots:
        axes.grid(visible=True, color="#e3e3e3", linewidth=0.8)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.margins(x=0.02)
        for spp in marks.stops.values():
            axes.axvline(spp, color=_STOP, linewidth=1, linestyle=(0, (4, 3)))
    _name_stops(plots[0], marks.stops)
    return figure


def _outcome(job: Job) -> str:
    saved = f", {share(job.saved_fraction)} of the cap saved" if job.samples_saved else ""
    return f"{job.outcome} at {job.spp:,} spp{saved}"


def _draw_changed(axes: "Axes", points: list[CurvePoint], marks: Marks) -> None:
    spp = np.array([point.spp for point in points], dtype=np.float64)
    changed = np.array([point.visible_pixels for point in points], dtype=np.float64)
    axes.plot(spp, changed, "o-", color=_CURVE, markersize=4)
    _label(axes, "left", "changed since the first image, in pixels", _CURVE)
    axes.locator_params(axis="y", integer=True)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:,.0f}")
    # Room for the names of the stops above the data.
    axes.set_ylim(bottom=0, top=max(1.0, (1.12 + 0.05 * len(marks.stops)) * changed.max()))
    slope, window, stop_slope = points[-1].slope, marks.window, marks.stop_slope
    if slope is not None:
        last_spp, last_changed = spp[-window:], changed[-window:]
        line = last_changed.mean() + slope * (last_spp - last_spp.mean())
        axes.plot(last_spp, line, color=_LINE, linewidth=5, alpha=0.5, zorder=1)
        aim = "" if stop_slope is None else f", stops at {significant(stop_slope)}"
        _label(axes, "right", f"last {window} points: {significant(slope)} px/spp{aim}", _LINE)
    if points[-1].visible_fraction > 0:
        pixels = points[-1].visible_pixels / points[-1].visible_fraction
        of_image = axes.twinx()
        of_image.set_ylim(0, 100 * axes.get_ylim()[1] / pixels)
        of_image.yaxis.set_major_formatter(lambda value, _: f"{significant(value)} %")
        of_image.tick_params(labelsize=_SMALLEST)
        of_image.spines[["top", "left"]].set_visible(False)
        of_image.spines["right"].set_color("#c0c0c0")


def _draw_noise_left(axes: "Axes", points: list[CurvePoint], target: float | None) -> None:
    known = [point for point in points if point.estimate_pixels]
    _label(axes, "left", "noise left, in pixels, by half buffers", _ESTIMATE)
    if not known:
        axes.text(0.5, 0.5, "none was found", transform=axes.transAxes, ha="center")
        return
    spp = [point.spp for point in known]
    left = [point.estimate_pixels or 0.0 for point in known]
    axes.plot(spp, left, "s-", color=_ESTIMATE, markersize=3.5)
    low = [point.estimate_low_pixels or 0.0 for point in known]
    high = [point.estimate_high_pixels or 0.0 for point in known]
    if all(low) and all(high):
        axes.fill_between(spp, low, high, color=_ESTIMATE, alpha=0.18, linewidth=0)
    axes.set_yscale("log")
    # Plain numbers: to typeset powers of ten takes longer than the rest of the picture.
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:,.12g}")
    axes.yaxis.set_minor_formatter(lambda *_: "")
    if target is not None and known[-1].estimate_fraction:
        allowed = target * left[-1] / known[-1].estimate_fraction
        axes.axhline(allowed, color=_LINE, linewidth=2, alpha=0.6)
        label = f"target: {100 * target:g} % of the image, {significant(allowed)} px"
        _label(axes, "right", label, _LINE)


def _draw_values(axes: "Axes", points: list[CurvePoint], rule: StoppingRule) -> None:
    said = {point.spp: point.rules[rule.name].value for point in points if rule.name in point.rules}
    known = {spp: value for spp, value in said.items() if value is not None}
    _label(axes, "left", f"{rule.quantity}, in {rule.unit}", _CURVE)
    if not known:
        axes.text(0.5, 0.5, "none was found", transform=axes.transAxes, ha="center")
        return
    axes.plot(list(known), list(known.values()), "o-", color=_CURVE, markersize=3.5)
    if rule.value_target is not None:
        axes.axhline(rule.value_target, color=_LINE, linewidth=2, alpha=0.6)
        _label(axes, "right", f"target: {rule.value_target:g} {rule.unit}", _LINE)


def _label(axes: "Axes", side: Literal["left", "right"], text: str, colour: str) -> None:
    """Write the label of the line of this colour above a plot, at one of its sides."""
    axes.set_title(text, loc=side, fontsize=_SMALL, color=colour, pad=5)


def _name_stops(axes: "Axes", stops: Mapping[str, int]) -> None:
    """Write the names of the stops beside their lines, each lower than the one before."""
    start, end = axes.get_xlim()
    for number, (name, spp) in enumerate(stops.items()):
        is_left = spp < (start + end) / 2  # at the side where there is more room
        axes.annotate(
            name,
            xy=(spp, 1),
            xycoords=("data", "axes fraction"),
            xytext=(3 if is_left else -3, -10 - 11 * number),
            textcoords="offset points",
            ha="left" if is_left else "right",
            fontsize=_SMALLEST,
            color=_STOP,
        )
