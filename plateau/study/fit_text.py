"""What `plateau study fit` prints of the fits."""

from dataclasses import asdict
from typing import Any, Final

from plateau.errors import tell
from plateau.study.answers import AnswersFit
from plateau.study.answers_table import FittedScene
from plateau.study.model import PROBABILITIES

_NO_INTERVALS: Final = (
    "a table of shares does not say how many answers it is made of, so there are no intervals; fit "
    "the single answers (trials.csv) to get them"
)


def print_fits(fitted: list[FittedScene]) -> None:
    """Print the fits as a table, a line for each scene."""
    if isinstance(fitted[0].fit, AnswersFit):
        _print_answers(fitted)
    else:
        _print_shares(fitted)
        tell(_NO_INTERVALS)


def _print_shares(fitted: list[FittedScene]) -> None:
    width = max(len(one.scene) for one in fitted)
    thresholds = "".join(f"{f'{probability:.0%} at':>10}" for probability in PROBABILITIES)
    print(f"{'scene':<{width}}{'a':>11}{'b':>9}{'c':>7}{'r':>9}{thresholds}")
    for one in fitted:
        places = "".join(_place(one.threshold(probability)) for probability in PROBABILITIES)
        figures = asdict(one.fit)
        print(f"{one.scene:<{width}}{_fitted(one)}{figures['c']:>7.2f}{figures['r']:>9.3f}{places}")


def _print_answers(fitted: list[FittedScene]) -> None:
    width = max(len("scene"), *(len(one.scene) for one in fitted))
    thresholds = "".join(f"{f'{p:.0%} at':>10}{'95 % interval':>18}" for p in PROBABILITIES)
    print(f"{'scene':<{width}}{'answers':>9}{'observers':>11}{'a':>11}{'b':>9}{thresholds}")
    for one in fitted:
        assert isinstance(one.fit, AnswersFit)
        places = "".join(
            f"{_place(one.threshold(p))}{_between(one.interval(p)):>18}" for p in PROBABILITIES
        )
        print(
            f"{one.scene:<{width}}{one.fit.answers:>9}{one.fit.observers:>11}{_fitted(one)}{places}"
        )


def _fitted(one: FittedScene) -> str:
    """The columns of a and b."""
    if one.refusal:
        return f"{'–':>11}{'–':>9}"
    return f"{one.fit.a:>11.5f}{one.fit.b:>9.3f}"


def _place(spp: float | None) -> str:
    return f"{'–' if spp is None else f'{spp:,.0f}':>10}"


def _between(interval: tuple[float, float] | None) -> str:
    return "–" if interval is None else f"{interval[0]:,.0f} – {interval[1]:,.0f}"


def as_json(one: FittedScene) -> dict[str, object]:
    """The fit as a document."""
    figures: dict[str, Any] = asdict(one.fit)
    figures.pop("covariances", None)
    if one.refusal:
        figures |= {"a": None, "b": None}
    thresholds = {f"{probability:g}": one.threshold(probability) for probability in PROBABILITIES}
    found: dict[str, object] = {"scene": one.scene, **figures, "threshold_spp": thresholds}
    if isinstance(one.fit, AnswersFit):
        found["interval_spp"] = {f"{p:g}": one.interval(p) for p in PROBABILITIES}
    found["warnings"] = one.warnings()
    return found
