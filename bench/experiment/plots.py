"""The experiment's pictures: the paper's figures 4 to 6 on our scenes, and the truth."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.experiment.contenders import TARGET
from bench.experiment.truth import reference_spp, true_spp

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from bench.experiment.series import Curve, Measured

_INKS: Final = ("#1f6f8b", "#d1495b", "#6b4e9b", "#c78a1e")
_TRUE: Final = "#3a3a3a"
_DPI: Final = 110


def plot_counts(series: Sequence[Measured], rules: Sequence[str], path: Path) -> None:
    """Write what rules counted, evaluation by evaluation: figures 4 and 5.

    Each series has a panel, and each rule, a contender with its step, has a line.
    """
    with panels(_names(series), path, "visible pixels") as every:
        for axes, one in zip(every, series, strict=True):
            for ink, name in zip(_INKS, rules, strict=False):
                curve = one.curves[name]
                counts = _numbers(curve.value if curve.visible[-1] is None else curve.visible)
                axes.plot(curve.spp, counts, color=ink, linewidth=1, label=name)
                _mark_stop(axes, curve, ink)
            axes.set_yscale("symlog", linthresh=1)
            _mark(axes, true_spp(one, TARGET))


def plot_reverse(series: Sequence[Measured], path: Path) -> None:
    """Write the reverse curves and their regression coefficients, at both steps: figure 6."""
    names = [name for name in series[0].curves if name.startswith("reverse @")]
    label = "visible pixels against the first image"
    with panels(_names(series), path, label) as every:
        for axes, one in zip(every, series, strict=True):
            slopes = axes.twinx()
            slopes.set_yscale("log")
            slopes.tick_params(labelsize=7, colors="#808080")
            for ink, name in zip(_INKS, names, strict=False):
                curve = one.curves[name]
                axes.plot(curve.spp, _numbers(curve.visible), color=ink, linewidth=1.4, label=name)
                slope = _numbers(curve.value)
                slope[~(slope > 0)] = np.nan  # a slope of 0 or less has no logarithm
                slopes.plot(curve.spp, slope, color=ink, linewidth=0.6, alpha=0.6)
                _mark_stop(axes, curve, ink)
            axes.set_ylim(bottom=0)
            _mark(axes, true_spp(one, TARGET))


def plot_truth(series: Sequence[Measured], path: Path) -> None:
    """Write the truth by the independent reference, and the half-buffer estimate with its band."""
    with panels(_names(series), path, "pixels still visibly wrong") as every:
        for axes, one in zip(every, series, strict=True):
            known = [
                (spp, *estimate)
                for spp, estimate in zip(one.spp, one.estimate, strict=True)
                if estimate is not None
            ]
            spp, estimate, low, high = (np.array(column) for column in zip(*known, strict=True))
            ink = _INKS[2]
            axes.fill_between(spp, low, high, color=ink, alpha=0.18, linewidth=0)
            axes.plot(spp, estimate, color=ink, linewidth=1, label="half-buffer estimate")
            axes.plot(one.spp, one.truth, color=_TRUE, linewidth=1.4, label="against the reference")
            axes.axhline(TARGET * one.pixels**2, color="#a0a0a0", linewidth=0.8)
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_ylim(bottom=0.7)
            _mark(axes, reference_spp(one, TARGET))


@contextmanager
def panels(
    names: Sequence[str], path: Path, label: str, *, columns: int = 2
) -> Iterator[Sequence[Axes]]:
    """Yield a panel for each name; then write the picture, with the first panel's legend."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = -(-len(names) // columns)
    figure = Figure(figsize=(10, 2.5 * rows + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    all_ = list(figure.subplots(rows, columns, squeeze=False).flat)
    for unused in all_[len(names) :]:
        unused.set_axis_off()
    used = all_[: len(names)]
    for axes, name in zip(used, names, strict=True):
        axes.set_title(name, fontsize=10, loc="left")
        axes.grid(visible=True, color="#e8e8e8", linewidth=0.7)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=8)
    yield used
    figure.supxlabel("samples per pixel (spp)", fontsize=9)
    figure.supylabel(label, fontsize=9)
    handles, labels = used[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=len(labels), fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=_DPI)


def _names(series: Sequence[Measured]) -> list[str]:
    return [one.name for one in series]


def _numbers(values: Sequence[float | None]) -> NDArray[np.float64]:
    return np.array([np.nan if value is None else value for value in values])


def _mark_stop(axes: Axes, curve: Curve, ink: str) -> None:
    if curve.stop is not None:
        axes.axvline(curve.stop, color=ink, linewidth=1, linestyle=(0, (4, 3)))


def _mark(axes: Axes, spp: float | None) -> None:
    if spp is not None:
        axes.axvline(spp, color=_TRUE, linewidth=1.2, linestyle=":")
