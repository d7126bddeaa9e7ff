"""The curve as a picture: visible pixels over spp, and what is left to see."""

import threading
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from farm.job import CurvePoint, Job
from plateau import words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CURVE: Final = "#1f6f8b"
_LINE: Final = "#d1495b"
_ESTIMATE: Final = "#6b4e9b"
_STOP: Final = "#5a5a5a"
_DPI: Final = 150
#: Room for what is written around the axes, in shares of the figure: a layout that measures the
#: text draws everything thrice.
_MARGINS: Final = {"left": 0.16, "right": 0.93, "bottom": 0.09, "top": 0.93, "hspace": 0.09}


def import_ahead() -> None:
    """Import what plotting needs, in a thread: it takes half a second, which others may wait in."""
    threading.Thread(
        target=import_module, args=("matplotlib.figure",), name="imports", daemon=True
    ).start()


def plot_job(job: Job, points: list[CurvePoint], path: Path) -> None:
    """Write the curve of a job as a PNG file; see `plot_curve`."""
    plot_curve(
        f"{Path(job.name).stem}: {_outcome(job)}",
        points,
        path,
        window=words.rule_window(job),
        stop_slope=words.stop_slope(job),
        target=words.stop_fraction(job),
        stops={"": job.spp} if job.state.ended else {},
    )


def plot_curve(
    title: str,
    points: list[CurvePoint],
    path: Path,
    *,
    window: int,
    stop_slope: float | None,
    target: float | None,
    stops: Mapping[str, int],
) -> None:
    """Write a curve as a PNG file of 1200 × 900 pixels.

    Above, the pixels that differ visibly from the first image, with the regression line over the
    last window and its slope against the rule's; below, on a logarithmic axis, the half-buffer
    estimate of those that still differ from the converged image, with its band.

    Parameters
    ----------
    title
        What is written above.
    points
        The curve, by rising spp.
    path
        The file.
    window, stop_slope
        How many points the regression line is laid through, and the slope at which it stops, in
        visible pixels per spp of this image.
    target
        The share of the pixels at which the estimate stops the job.
    stops
        Where vertical lines are drawn, in spp, by what is written beside them.
    """
    # Matplotlib takes a second to import; only those who plot wait for it.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 6))
    FigureCanvasAgg(figure)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2), gridspec_kw=_MARGINS)
    figure.suptitle(title, x=0.01, ha="left", fontweight="bold")
    _draw_visible(above, points, window, stop_slope)
    _draw_estimate(below, points, target)
    below.set_xlabel("samples per pixel (spp)")
    for axes in (above, below):
        axes.grid(visible=True, color="#e3e3e3", linewidth=0.8)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.margins(x=0.02)
        for spp in stops.values():
            axes.axvline(spp, color=_STOP, linewidth=1, linestyle=(0, (4, 3)))
    for number, (name, spp) in enumerate(stops.items()):
        # From the top down, so that rules that stop close together stay legible.
        place = {"xytext": (3, -12 - 11 * number), "textcoords": "offset points"}
        at = {"xy": (spp, 1), "xycoords": ("data", "axes fraction")}
        above.annotate(name, **at, **place, fontsize=8, color=_STOP)
    figure.savefig(path, dpi=_DPI)


def _outcome(job: Job) -> str:
    saved = f", {words.percent(job.saved_fraction)} of the cap saved" if job.samples_saved else ""
    return f"{job.state.value} at {job.spp:,} spp{saved}"


def _draw_visible(
    axes: "Axes", points: list[CurvePoint], window: int, stop_slope: float | None
) -> None:
    spp = np.array([point.spp for point in points], dtype=np.float64)
    visible = np.array([point.visible_pixels for point in points], dtype=np.float64)
    axes.plot(spp, visible, "o-", color=_CURVE, markersize=4, label="visible pixels")
    axes.set_ylabel("pixels that differ visibly\nfrom the first image")
    axes.locator_params(axis="y", integer=True)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:,.0f}")
    axes.set_ylim(bottom=0, top=max(1.0, 1.12 * visible.max()))
    slope = points[-1].slope
    if slope is not None:
        last_spp, last_visible = spp[-window:], visible[-window:]
        line = last_visible.mean() + slope * (last_spp - last_spp.mean())
        aim = "" if stop_slope is None else f", stops at {words.significant(stop_slope)}"
        label = f"last {window} points: slope {words.significant(slope)} px/spp{aim}"
        axes.plot(last_spp, line, color=_LINE, linewidth=5, alpha=0.5, zorder=1, label=label)
    if points[-1].visible_fraction > 0:
        pixels = points[-1].visible_pixels / points[-1].visible_fraction
        share = axes.twinx()
        share.set_ylim(0, 100 * axes.get_ylim()[1] / pixels)
        share.set_ylabel("% of the image")
        share.spines[["top", "left"]].set_visible(False)
        share.spines["right"].set_color("#c0c0c0")
    axes.legend(loc="lower right", framealpha=1, edgecolor="none")


def _draw_estimate(axes: "Axes", points: list[CurvePoint], target: float | None) -> None:
    known = [point for point in points if point.estimate_pixels]
    axes.set_ylabel("still visible\n(half-buffer estimate)")
    if not known:
        axes.text(0.5, 0.5, "no estimate above 0", transform=axes.transAxes, ha="center")
        return
    spp = [point.spp for point in known]
    estimate = [point.estimate_pixels or 0.0 for point in known]
    axes.plot(spp, estimate, "s-", color=_ESTIMATE, markersize=3.5, label="pixels still visible")
    low = [point.estimate_low_pixels or 0.0 for point in known]
    high = [point.estimate_high_pixels or 0.0 for point in known]
    if all(low) and all(high):
        axes.fill_between(spp, low, high, color=_ESTIMATE, alpha=0.18, linewidth=0)
    axes.set_yscale("log")
    # Not as powers of ten, whose typesetting takes longer than the rest of the picture
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:,.12g}")
    if target is not None and known[-1].estimate_fraction:
        pixels = estimate[-1] / known[-1].estimate_fraction
        few = words.significant(target * pixels)
        label = f"stops at {100 * target:g} % of the image, {few} px"
        axes.axhline(target * pixels, color=_LINE, linewidth=2, alpha=0.6, label=label)
        axes.legend(loc="upper right", framealpha=1, edgecolor="none")
