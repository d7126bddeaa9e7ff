"""`plateau study`: making, listing, exporting, deleting and fitting observer studies."""

import json
import math
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from plateau.commands.connect import connect
from plateau.errors import CommandFailed
from plateau.exit_codes import ExitCode
from plateau.farm.model.job import CurvePoint, Job
from plateau.study.answers import AnswersFit
from plateau.study.answers_table import FittedScene, fit_table, plot_study
from plateau.study.client import StudyCalls
from plateau.study.model import PROBABILITIES
from plateau.study.order import Method
from plateau.study.views import StudyView
from plateau.terminal.tables import print_rows

_NO_INTERVALS = (
    "a table of shares does not say how many answers it is made of, so there are no intervals; fit "
    "the single answers (trials.csv) to get them"
)
_COLUMNS = ("id", "name", "method", "levels", "observers", "answers", "50 % at", "95 % interval")


def create(
    job_id: str,
    *,
    reference: str | None,
    method: Method,
    levels: list[int],
    at_stops: bool,
    name: str | None,
    url: str | None,
    as_json: bool,
) -> None:
    """Make a study of a job; print its id, and where observers take part."""
    with connect(url) as client:
        whole_id = client.whole_id(job_id)
        if at_stops:
            levels = levels_at_stops(client.job(whole_id), client.curve(whole_id))
        study = StudyCalls(client).create(
            whole_id,
            reference_job_id=None if reference is None else client.whole_id(reference),
            method=method,
            levels=levels or None,
            name=name,
        )
        print(study.model_dump_json(indent=2) if as_json else study.id)
        if not as_json:
            print(f"plateau: observers go to {client.url}{study.links['observe']}", file=sys.stderr)
            if not study.independent:
                print(
                    "plateau: the reference contains the samples of the test images, which "
                    "therefore seem closer to it than they are; name a job with another seed as "
                    "--reference",
                    file=sys.stderr,
                )


def levels_at_stops(job: Job, points: list[CurvePoint]) -> list[int]:
    """Return the spp of test images that tell where rules disagree, in whole slices.

    They are where each rule first stopped, the geometric mean of the first and the last of these,
    half of the first, and twice the last as far as the job has samples.

    Raises
    ------
    CommandFailed
        Fewer than two rules stopped, or all at one point.
    """
    names = {name for point in points for name in point.rules}
    first = {name: next((at.spp for at in points if _stops(at, name)), None) for name in names}
    stops = sorted({spp for spp in first.values() if spp is not None})
    if len(stops) < 2:
        raise CommandFailed(
            f"the rules of job {job.id} do not disagree: {_said(first)}; watch another one "
            "(--watch jod), or choose the test images by --level"
        )
    wanted = (stops[0] / 2, *stops, math.sqrt(stops[0] * stops[-1]), 2 * stops[-1])
    slices = {max(1, round(spp / job.spec.slice_spp)) for spp in wanted}
    levels = (job.spec.slice_spp * one for one in sorted(slices))
    return [spp for spp in levels if spp <= job.committed_spp]


def _stops(point: CurvePoint, rule: str) -> bool:
    return rule in point.rules and point.rules[rule].stop


def _said(first: dict[str, int | None]) -> str:
    said = ", ".join(
        f"{name} {'never stopped' if spp is None else f'stopped at {spp:,} spp'}"
        for name, spp in sorted(first.items())
    )
    return said or "its curve has no point"


def list_studies(*, url: str | None, as_json: bool) -> None:
    """Print all studies."""
    with connect(url) as client:
        studies = StudyCalls(client).all()
    if as_json:
        print(json.dumps([study.model_dump(mode="json") for study in studies], indent=2))
        return
    spare = ("method", "levels", "95 % interval")
    print_rows(_COLUMNS, list(map(_row, studies)), none="there are no studies", spare=spare)


def export(study_id: str, *, table: bool, out: Path | None, url: str | None, as_json: bool) -> None:
    """Write the answers of a study, or its table, to a file or to standard output."""
    with connect(url) as client:
        if as_json:
            text = StudyCalls(client).get(study_id).model_dump_json(indent=2) + "\n"
        else:
            text = StudyCalls(client).csv(study_id, "answers" if table else "trials")
    if out is None:
        sys.stdout.write(text)
    else:
        out.write_text(text, encoding="utf-8")


def delete(study_id: str, *, url: str | None) -> None:
    """Remove a study with its answers."""
    with connect(url) as client:
        StudyCalls(client).delete(study_id)


def fit(table: Path, *, plot: Path | None, as_json: bool) -> int:
    """Fit a table, plot and print it; the exit code says whether any scene has a fit."""
    fitted = fit_table(table)
    if plot is not None:
        plot_study(fitted, plot)
    if as_json:
        print(json.dumps([_as_json(one) for one in fitted], indent=2))
    elif isinstance(fitted[0].fit, AnswersFit):
        _print_answers(fitted)
    else:
        _print_table(fitted)
        print(f"plateau: {_NO_INTERVALS}", file=sys.stderr)
    for one in fitted:
        for told in one.warnings():
            print(f"plateau: {one.scene}: {told}", file=sys.stderr)
    return ExitCode.FAILED if all(one.refusal for one in fitted) else ExitCode.OK


def _print_table(fitted: list[FittedScene]) -> None:
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


def _as_json(one: FittedScene) -> dict[str, object]:
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


def _row(study: StudyView) -> tuple[str, ...]:
    half = next((one for one in study.result.thresholds if one.probability == 0.5), None)
    interval = None
    if half is not None and half.low_spp is not None and half.high_spp is not None:
        interval = (half.low_spp, half.high_spp)
    return (
        study.id,
        study.name,
        study.method,
        f"{study.levels[0]}–{study.levels[-1]} spp",
        f"{study.result.finished} of {study.result.observers}",
        str(study.result.answers),
        "–" if half is None else f"{half.spp:,.0f} spp",
        _between(interval),
    )
