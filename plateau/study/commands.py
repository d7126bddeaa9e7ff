"""`plateau study`: making, listing, exporting, deleting and fitting observer studies."""

import math
import sys
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from plateau.commands import options as o
from plateau.commands.app import group
from plateau.commands.connect import connect
from plateau.commands.printing import print_json, print_one, print_table
from plateau.errors import CommandFailed, ExitCode, tell

if TYPE_CHECKING:
    from plateau.farm.model.job import CurvePoint, Job
    from plateau.study.views import StudyView

_COLUMNS = ("id", "name", "method", "levels", "observers", "answers", "50 % at", "95 % interval")

study = group(
    "study", "Observer studies: at which spp do people stop seeing a difference?", extra="plot"
)

_StudyId = Annotated[str, typer.Argument(metavar="ID", help="The study's id.")]


class _Method(str, Enum):
    CONSTANT = "constant"
    LIMITS = "limits"


@study.command()
def create(
    job_id: o.JobId,
    reference: Annotated[
        str | None,
        typer.Option(
            metavar="JOB_ID",
            help="Job whose image is the reference; preferably with another seed.",
            show_default="the job itself",
        ),
    ] = None,
    method: Annotated[
        _Method,
        typer.Option(help="constant measures the thresholds; limits finds levels for it first."),
    ] = _Method.CONSTANT,
    level: Annotated[
        list[int] | None,
        typer.Option(
            metavar="SPP",
            help="Spp of a test image; may be repeated.",
            show_default="1 % to 25 % of the reference's",
        ),
    ] = None,
    at_stops: Annotated[
        bool,
        typer.Option(
            "--at-stops",
            help="Test images where the job's rules, its own and those that it watched, stopped or "
            "would have, between the first and the last, at half the first and at twice the last.",
        ),
    ] = False,
    name: Annotated[
        str | None, typer.Option(help="Name of the study.", show_default="the job's name")
    ] = None,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Make a study from the kept slices of an ended job, and print its id.

    For example:
      plateau study create 3f9ac2d01b77 --reference 8e11d0c2b7a4
      plateau study create 3f9ac2d01b77 --method limits --name "BAR, first stage"
      plateau study create 3f9ac2d01b77 --reference 8e11d0c2b7a4 --at-stops

    The job must have kept its slices (--keep-slices). Observers take part on the web page, at the
    URL printed to standard error. docs/study.md explains how to run a study.
    """
    if at_stops and level:
        raise typer.BadParameter("--level and --at-stops both choose the test images: give one")

    from plateau.study.client import StudyCalls

    with connect(url) as client:
        whole_id = client.whole_id(job_id)
        if at_stops:
            level = levels_at_stops(client.job(whole_id), client.curve(whole_id))
        study = StudyCalls(client).create(
            whole_id,
            reference_job_id=None if reference is None else client.whole_id(reference),
            method=method.value,
            levels=level or None,
            name=name,
        )
        print_one(study, study.id, as_json=as_json)
        if not as_json:
            tell(f"observers go to {client.url}{study.links['observe']}")
            if not study.independent:
                tell(
                    "the reference contains the samples of the test images, which therefore seem "
                    "closer to it than they are; name a job with another seed as --reference"
                )


def levels_at_stops(job: "Job", points: "list[CurvePoint]") -> list[int]:
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


def _stops(point: "CurvePoint", rule: str) -> bool:
    return rule in point.rules and point.rules[rule].stop


def _said(first: dict[str, int | None]) -> str:
    said = ", ".join(
        f"{name} {'never stopped' if spp is None else f'stopped at {spp:,} spp'}"
        for name, spp in sorted(first.items())
    )
    return said or "its curve has no point"


@study.command("list")
def list_studies(url: o.Url = None, as_json: o.Json = False) -> None:
    """List the studies, newest first, with their results so far.

    For example:
      plateau study list
    """
    from plateau.study.client import StudyCalls

    with connect(url) as client:
        studies = StudyCalls(client).all()
    none, spare = "there are no studies", ("method", "levels", "95 % interval")
    print_table(studies, _COLUMNS, _row, none=none, spare=spare, as_json=as_json)


def _row(study: "StudyView") -> tuple[str, ...]:
    half = next((one for one in study.result.thresholds if one.probability == 0.5), None)
    return (
        study.id,
        study.name,
        study.method,
        f"{study.levels[0]}–{study.levels[-1]} spp",
        f"{study.result.finished} of {study.result.observers}",
        str(study.result.answers),
        "–" if half is None else f"{half.spp:,.0f} spp",
        "–" if half is None else f"{half.low_spp:,.0f} – {half.high_spp:,.0f}",
    )


@study.command()
def export(
    study_id: _StudyId,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FILE", help="File to write.", show_default="stdout"),
    ] = None,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Export the answers of a study as CSV, one line each; with --json, its results.

    For example:
      plateau study export 9c1f47be02d8 -o trials.csv
      plateau study fit trials.csv --plot thresholds.png
    """
    from plateau.study.client import StudyCalls

    with connect(url) as client:
        if as_json:
            text = StudyCalls(client).get(study_id).model_dump_json(indent=2) + "\n"
        else:
            text = StudyCalls(client).trials_csv(study_id)
    if out is None:
        sys.stdout.write(text)
    else:
        from plateau.files.job_folder import whole

        with whole(out) as file:
            file.write_text(text, encoding="utf-8")


@study.command()
def delete(study_id: _StudyId, url: o.Url = None) -> None:
    """Delete a study with all its answers and pictures. This cannot be undone.

    For example:
      plateau study delete 9c1f47be02d8
    """
    from plateau.study.client import StudyCalls

    with connect(url) as client:
        StudyCalls(client).delete(study_id)


@study.command("fit")
def fit(
    table: Annotated[
        Path,
        typer.Argument(help="A CSV file of single answers, or in the form of the paper's table 1."),
    ],
    plot: Annotated[
        Path | None, typer.Option(metavar="OUT.png", help="File for a plot of answers and fits.")
    ] = None,
    as_json: o.Json = False,
) -> None:
    """Fit the probability of seeing a difference, for each scene of a study.

    TABLE has one line for each answer, as `plateau study export` writes it, and each threshold gets
    a 95 % confidence interval. Or it has a column "scene" and one column for each number of samples
    per pixel that was shown, with the share of the observers who saw a difference. It is then
    fitted as in the paper.

    There is no fit for fewer than 20 answers, or if differences were not seen less often with more
    samples. A threshold that the answers do not bound is left open. Standard error says why. The
    exit code is 1 if no scene has a fit.

    For example:
      plateau study fit trials.csv --plot thresholds.png
    """
    from plateau.study import fit_text
    from plateau.study.answers_table import fit_table, plot_study

    fitted = fit_table(table)
    if plot is not None:
        plot_study(fitted, plot)
    if as_json:
        print_json([fit_text.as_json(one) for one in fitted])
    else:
        fit_text.print_fits(fitted)
    for one in fitted:
        for told in one.warnings():
            tell(f"{one.scene}: {told}")
    raise typer.Exit(ExitCode.FAILED if all(one.refusal for one in fitted) else ExitCode.OK)
