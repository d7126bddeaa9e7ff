"""The Markdown tables of docs/science/paper.md."""

from __future__ import annotations

import statistics
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bench.experiment.contenders import TARGET
from bench.experiment.series import ASKED_AT
from bench.experiment.truth import TARGETS, reference_spp, true_spp, truth_at
from bench.support.markdown import table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bench.experiment.series import Measured

#: Spp that the paper renders without a rule.
PAPER_CAP = 10_000
#: The spp at which the estimate is compared with the truth.
_ESTIMATED_AT = (100, 200, 400, 800, 1600, 3200)
#: The spp at which the forecast is compared with the truth.
_FORECAST_AT = (100, 200, 400, 800, 1600)
#: A stop further from the truth than this misses the goal.
GOAL = 0.10
#: A stop with more than this many times the target still visible is a false one.
FALSE_STOP = 3.0


@dataclass(frozen=True)
class Stop:
    """Where one contender stopped in one series."""

    spp: int | None  #: None if it had not stopped by the cap
    error: float | None  #: `spp` over the true one, less 1; None if either is unknown
    wrong: float | None  #: share of pixels visibly wrong then, without the reference's noise
    saved: float  #: share of the paper's 10,000 spp that were not rendered


def stops(measured: Measured) -> dict[str, Stop]:
    """Return where each contender stopped in a series."""
    true = true_spp(measured, TARGET)
    found = {}
    for name, curve in measured.curves.items():
        spp = curve.stop
        wrong = None if spp is None else truth_at(measured, spp)
        found[name] = Stop(
            spp,
            error=None if spp is None or true is None else spp / true - 1,
            wrong=None if wrong is None else wrong / measured.pixels**2,
            saved=0.0 if spp is None else 1 - spp / PAPER_CAP,
        )
    return found


def truth_table(series: Sequence[Measured]) -> str:
    """Return the spp from which each image is converged, by target."""
    head = ["scene", "rendered to"]
    head += [f"{target:.2%} against the reference" for target in TARGETS]
    head += [f"{target:.2%} against the truth" for target in TARGETS]
    rows = [
        [
            one.name,
            f"{one.cap:,}",
            *(_spp(reference_spp(one, target), one.cap) for target in TARGETS),
            *(_spp(true_spp(one, target), one.cap / 2) for target in TARGETS),
        ]
        for one in series
    ]
    return table(head, rows)


def stop_table(series: Sequence[Measured], step: int) -> str:
    """Return where every contender stopped at one step, and how far that is from the truth."""
    names = [name for name in series[0].curves if name.endswith(f"@{step}")]
    head = ["scene", "true", *(name.removesuffix(f" @{step}") for name in names)]
    rows = []
    for one in series:
        found = stops(one)
        cells = [_stop(found[name], one.cap) for name in names]
        rows.append([one.name, _spp(true_spp(one, TARGET), one.cap / 2), *cells])
    return table(head, rows)


def summary_table(series: Sequence[Measured]) -> str:
    """Return how far off each contender was over all scenes, and what it saved."""
    head = [
        "rule @ step",
        "off by, median",
        "worst",
        f"within {GOAL:.0%}",
        f"false stops (over {FALSE_STOP * TARGET:.1%} wrong)",
        "never stopped",
        "samples saved, median",
    ]
    rows = []
    for name in series[0].curves:
        found = [stops(one)[name] for one in series]
        errors = [stop.error for stop in found if stop.error is not None]
        wrong = [stop.wrong for stop in found if stop.wrong is not None]
        rows.append(
            [
                name.replace("@", "@ "),
                f"{statistics.median(map(abs, errors)):.0%}" if errors else "–",
                f"{max(errors, key=abs):+.0%}" if errors else "–",
                f"{sum(abs(error) <= GOAL for error in errors)} of {len(errors)}",
                f"{sum(share > FALSE_STOP * TARGET for share in wrong)}",
                f"{sum(stop.spp is None for stop in found)}",
                f"{statistics.median(stop.saved for stop in found):.0%}",
            ]
        )
    return table(head, rows)


def estimate_table(series: Sequence[Measured]) -> str:
    """Return the half-buffer estimate over the truth, by scene and spp."""
    rows = []
    for one in series:
        estimates = dict(zip(one.spp, one.estimate, strict=True))
        cells = []
        for spp in _ESTIMATED_AT:
            truth, estimate = truth_at(one, spp), estimates.get(spp)
            cells.append(
                "–"
                if truth is None or estimate is None or truth < 1
                else f"{estimate[0] / truth:.2f} of {truth / one.pixels**2:.2%}"
                + ("" if estimate[1] <= truth <= estimate[2] else " *")
            )
        rows.append([one.name, *cells])
    return table(["scene", *(f"{spp:,} spp" for spp in _ESTIMATED_AT)], rows)


def forecast_table(series: Sequence[Measured]) -> str:
    """Return the forecast of the true spp over the true spp, by scene and spp."""
    rows = []
    for one in series:
        true = true_spp(one, TARGET)
        asked = [spp for spp in ASKED_AT if spp <= one.cap]
        ahead = dict(zip(asked, one.forecast, strict=True))
        cells = []
        for spp in _FORECAST_AT:
            found = ahead.get(spp)
            if found is None or true is None or spp >= true:
                cells.append("–")
            else:
                inside = "" if found[1] <= true <= found[2] else " *"
                cells.append(f"{found[0] / true:.2f}{inside}")
        rows.append([one.name, _spp(true, one.cap / 2), *cells])
    return table(["scene", "true", *(f"at {spp:,} spp" for spp in _FORECAST_AT)], rows)


def opinion_table(series: Sequence[Measured]) -> str:
    """Return what other metrics say of each image against the reference, by scene and spp."""
    rows = []
    for one in series:
        for name, values in one.opinions.items():
            said = dict(zip((spp for spp in ASKED_AT if spp <= one.cap), values, strict=True))
            row = [f"{said[spp]:.3f}" if spp in said else "–" for spp in ASKED_AT]
            true = true_spp(one, TARGET)
            then = None if true is None else np.interp(np.log(true), np.log([*said]), values)
            rows.append([one.name, name, *row, "–" if then is None else f"{then:.3f}"])
    head = ["scene", "metric", *(f"{spp:,} spp" for spp in ASKED_AT)]
    return table([*head, f"where {TARGET:.1%} is left"], rows)


def _stop(stop: Stop, cap: int) -> str:
    if stop.spp is None:
        return f"over {cap:,}"
    return f"{stop.spp:,}" + ("" if stop.error is None else f" ({stop.error:+.0%})")


def _spp(spp: float | None, most: float) -> str:
    return f"over {most:,.0f}" if spp is None else f"{spp:,.0f}"
