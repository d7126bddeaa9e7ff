"""`plateau study fit`: psychometrics of an observer study."""

import json
from dataclasses import asdict
from pathlib import Path

from plateau.study import PROBABILITIES, FittedScene, fit_table, plot_study


def fit(table: Path, *, plot: Path | None, as_json: bool) -> int:
    """Fit a table, plot it where asked, print; returns the exit code."""
    fitted = fit_table(table)
    if plot is not None:
        plot_study(fitted, plot)
    if as_json:
        print(json.dumps([_as_json(one) for one in fitted], indent=2))
        return 0
    width = max(len(one.scene) for one in fitted)
    thresholds = "".join(f"{f'{probability:.0%} at':>10}" for probability in PROBABILITIES)
    print(f"{'scene':<{width}}{'a':>11}{'b':>9}{'c':>7}{'r':>9}{thresholds}")
    for one in fitted:
        places = "".join(_place(one.threshold(probability)) for probability in PROBABILITIES)
        print(
            f"{one.scene:<{width}}{one.fit.a:>11.5f}{one.fit.b:>9.3f}{one.fit.c:>7.2f}"
            f"{one.fit.r:>9.3f}{places}"
        )
    return 0


def _place(spp: float | None) -> str:
    return f"{'–' if spp is None else f'{spp:,.0f}':>10}"


def _as_json(one: FittedScene) -> dict[str, object]:
    thresholds = {f"{probability:g}": one.threshold(probability) for probability in PROBABILITIES}
    return {"scene": one.scene, **asdict(one.fit), "threshold_spp": thresholds}
