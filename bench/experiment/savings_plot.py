"""The picture of docs/science/savings.md: where each rule ends each scene, and its noise there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from bench.experiment.contenders import TARGET
from bench.experiment.plots import panels
from bench.experiment.spending import FIXED_SPP, RULES
from bench.experiment.truth import truth_at

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from bench.experiment.spending import Spending

#: Marker and colour of each rule; ours are round.
_MARKS: Final = dict(
    zip(
        RULES,
        (
            ("o", "#1f6f8b"),
            ("o", "#7db8cc"),
            ("o", "#6b4e9b"),
            ("s", "#d1495b"),
            ("s", "#eba0aa"),
            ("^", "#8a5a00"),
            ("D", "#c78a1e"),
        ),
        strict=True,
    )
)
#: Drawn if less than a pixel is wrong, in per cent.
_NONE: Final = 0.0007


def plot_savings(every: Sequence[Spending], path: Path) -> None:
    """Write a panel for each scene: a mark for each rule, on the curve of the noise left.

    A rule with a hollow mark did not end the scene; a line below a mark means "at most".
    """
    names = [one.name for one in every]
    with panels(names, path, "pixels still visibly wrong, %", columns=4) as every_axes:
        for axes, one in zip(every_axes, every, strict=True):
            share = 100 / one.pixels**2
            known = [(spp, truth_at(one.measured, spp)) for spp in one.spp]
            spp, wrong = zip(*((x, y * share) for x, y in known if y is not None), strict=True)
            axes.plot(spp, np.maximum(wrong, _NONE), color="#b0b0b0", linewidth=1.2, zorder=1)
            axes.axhspan(_NONE / 2, 100 * TARGET, color="#eef4ee", zorder=0)
            for rule, (marker, ink) in _MARKS.items():
                stop = one.stops[rule]
                left = one.left(rule)
                height = max(left.pixels * share, _NONE)
                style: dict[str, Any] = {
                    "marker": marker,
                    "color": ink,
                    "markersize": 6.5,
                    "linestyle": "none",
                }
                face = ink if stop.ended else "white"
                axes.plot(stop.spp, height, markerfacecolor=face, zorder=3, **style)
                axes.plot([], [], label=rule, **style)
                if left.how == "at most" and height > _NONE:
                    axes.vlines(stop.spp, _NONE, height, color=ink, linewidth=0.8, linestyle=":")
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_xlim(min(50, one.spp[0]), 1.3 * FIXED_SPP)
            axes.set_ylim(_NONE / 1.5, 30)
            axes.set_xticks([100, 1000, 10_000], ["100", "1,000", "10,000"])
            axes.set_yticks([_NONE, 0.01, 0.1, 1, 10], ["none", "0.01", "0.1", "1", "10"])
            axes.minorticks_off()
