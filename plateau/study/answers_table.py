"""Tables of an observer study, fitted by the paper's psychometric function.

A table is a CSV file in one of two forms:

- that of the paper's table 1: a column `scene`, then one column for each level in samples per
  pixel, with the share of observers who perceived a difference from the reference. It is fitted as
  in the paper;
- single answers, a line each, as a study exports them, with the columns `scene`, `observer`, `spp`
  and `seen`. In their fit each answer counts once, and thresholds have intervals.
"""

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from plateau.errors import PlateauError
from plateau.study.answers import AnswersFit, fit_answers
from plateau.study.model import PROBABILITIES
from plateau.study.psychometrics import LogitFit, fit_logit

#: The columns of a table of single answers.
_ANSWERS: Final = frozenset({"scene", "observer", "spp", "seen"})


class CannotFit(PlateauError):
    """The table cannot be fitted; the message says where and why, in one line."""


@dataclass(frozen=True)
class FittedScene:
    """A scene of the table, with its fit."""

    scene: str
    spp: tuple[float, ...]
    probabilities: tuple[float, ...]
    fit: LogitFit | AnswersFit

    @property
    def refusal(self) -> str | None:
        """Why the fit is not shown, in words; None if it is."""
        return self.fit.refusal

    def threshold(self, probability: float) -> float | None:
        """The spp at which a difference is perceived with this probability.

        None if the fit is refused, or if the single answers do not bound the threshold.
        """
        single = isinstance(self.fit, AnswersFit)
        if self.refusal or (single and self.interval(probability) is None):
            return None
        return self.fit.threshold(probability)

    def interval(self, probability: float) -> tuple[float, float] | None:
        """The 95 % interval of the threshold; None for a table of shares, which has none."""
        if self.refusal or not isinstance(self.fit, AnswersFit):
            return None
        return self.fit.interval(probability)

    def warnings(self) -> list[str]:
        """What readers of the thresholds have to know, a sentence each."""
        if self.refusal:
            return [f"no fit: {self.refusal}"]
        return [told for one in PROBABILITIES if (told := self._warning(one))]

    def _warning(self, probability: float) -> str:
        spp, least, most = self.threshold(probability), min(self.spp), max(self.spp)
        if spp is None:
            return (
                f"the answers do not bound the threshold of {probability:.0%}; collect more of "
                "them, or show levels at which some see a difference and others do not"
            )
        if not least <= spp <= most:
            return (
                f"the threshold of {probability:.0%}, {spp:,.0f} spp, lies beyond what was shown, "
                f"{least:,.0f} to {most:,.0f} spp, and is only the curve's guess; show levels near "
                "it"
            )
        return ""


def fit_table(path: Path) -> list[FittedScene]:
    """Fit each scene of a table; `CannotFit` if it cannot be read, has neither form, or no fit."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            header, *rows = [row for row in csv.reader(file) if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise CannotFit(f"{path}: {why}") from error
    except ValueError:
        raise CannotFit(f"{path} is empty") from None
    if not rows:
        raise CannotFit(f"{path} has no rows below its header")
    if set(header) >= _ANSWERS:
        return _fit_answers(path, header, rows)
    spp = tuple(_number(path, 1, text) for text in header[1:])
    fitted = []
    for line, (scene, *cells) in enumerate(rows, start=2):
        if len(cells) != len(spp):
            raise CannotFit(f"{path}, line {line}: {_uneven(len(cells) + 1, len(header))}")
        probabilities = tuple(_number(path, line, cell) for cell in cells)
        try:
            fitted.append(FittedScene(scene, spp, probabilities, fit_logit(spp, probabilities)))
        except ValueError as error:
            hint = "; fit the single answers instead (trials.csv)" if 0 in probabilities else ""
            raise CannotFit(f"{path}, line {line} ({scene}): {error}{hint}") from error
    return fitted


def _fit_answers(path: Path, header: list[str], rows: list[list[str]]) -> list[FittedScene]:
    """Fit single answers, each scene on its own."""
    scenes: dict[str, list[tuple[float, bool, str]]] = {}
    for line, cells in enumerate(rows, start=2):
        if len(cells) != len(header):
            raise CannotFit(f"{path}, line {line}: {_uneven(len(cells), len(header))}")
        row = dict(zip(header, cells, strict=True))
        if row["seen"] not in {"true", "false"}:
            raise CannotFit(
                f"{path}, line {line}: seen is {row['seen']!r}; it must be true or false"
            )
        answer = (_number(path, line, row["spp"]), row["seen"] == "true", row["observer"])
        scenes.setdefault(row["scene"], []).append(answer)
    fitted = []
    for scene, answers in scenes.items():
        spps, seen, observers = zip(*answers, strict=True)
        levels = tuple(sorted(set(spps)))
        shares = tuple(
            float(np.mean([yes for spp, yes, _ in answers if spp == level])) for level in levels
        )
        try:
            fitted.append(FittedScene(scene, levels, shares, fit_answers(spps, seen, observers)))
        except ValueError as error:
            raise CannotFit(f"{path} ({scene}): {error}") from error
    return fitted


def plot_study(fitted: list[FittedScene], path: Path) -> None:
    """Write the fits as a PNG file in the form of the paper's figure 1.

    Each scene shows the shares as points, the fit as a curve over spp, the thresholds of 50 % and
    10 % as dotted lines, and their intervals as bands.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = min(3, len(fitted))
    lines = math.ceil(len(fitted) / columns)
    figure = Figure(figsize=(3.2 * columns, 2.4 * lines), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False)
    over = np.linspace(0, 1.5 * max(max(one.spp) for one in fitted), 200)
    for axes, one in zip(grid.flat, fitted, strict=False):
        axes.plot(one.spp, one.probabilities, "o", color="#1f6f8b", markersize=4)
        if one.refusal is None:
            axes.plot(over, one.fit.probability(over), color="#d1495b")
        for probability in PROBABILITIES:
            place = one.threshold(probability)
            if place is not None:
                axes.axvline(place, color="#5a5a5a", linewidth=0.8, linestyle=":")
            interval = one.interval(probability)
            if interval is not None:
                axes.axvspan(*interval, color="#5a5a5a", alpha=0.12, linewidth=0)
        axes.set_title(one.scene, fontsize=9)
        axes.set_ylim(0, 1.05)
        axes.set_xlim(over[0], over[-1])
    for axes in grid.flat[len(fitted) :]:
        axes.set_visible(False)
    figure.supxlabel("samples per pixel (spp)", fontsize=9)
    figure.supylabel("probability to perceive a difference", fontsize=9)
    figure.savefig(path, dpi=150)


def _uneven(cells: int, columns: int) -> str:
    has = "1 value" if cells == 1 else f"{cells} values"
    return f"the row has {has}, and the header names {columns} columns"


def _number(path: Path, line: int, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise CannotFit(f"{path}, line {line}: {text!r} is not a number") from None
