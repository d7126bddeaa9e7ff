"""The command line of observer studies."""

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from plateau.cli import options as o
from plateau.cli.app import group

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
            "would have; between the first and the last of them; and at half and twice their spp.",
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
    from plateau.study.commands import create as run

    if at_stops and level:
        raise typer.BadParameter("--level and --at-stops both choose the test images: give one")
    run(
        job_id,
        at_stops=at_stops,
        reference=reference,
        method=method.value,
        levels=level or [],
        name=name,
        url=url,
        as_json=as_json,
    )


@study.command("list")
def list_studies(url: o.Url = None, as_json: o.Json = False) -> None:
    """List the studies, newest first, with their results so far.

    For example:
      plateau study list
    """
    from plateau.study.commands import list_studies as run

    run(url=url, as_json=as_json)


@study.command()
def export(
    study_id: _StudyId,
    table: Annotated[
        bool, typer.Option("--table", help="Export shares, in the form of the paper's table 1.")
    ] = False,
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
    from plateau.study.commands import export as run

    run(study_id, table=table, out=out, url=url, as_json=as_json)


@study.command()
def delete(study_id: _StudyId, url: o.Url = None) -> None:
    """Delete a study with all its answers and pictures. This cannot be undone.

    For example:
      plateau study delete 9c1f47be02d8
    """
    from plateau.study.commands import delete as run

    run(study_id, url=url)


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
    from plateau.study.commands import fit as run

    raise typer.Exit(run(table, plot=plot, as_json=as_json))
