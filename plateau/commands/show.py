"""`plateau show | log`: what is known of a job or a batch."""

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.commands.connect import connect
from plateau.commands.printing import print_json, print_one

if TYPE_CHECKING:
    from plateau.client import Client
    from plateau.farm.model.batch import Extent
    from plateau.farm.model.shot import Shot
    from plateau.farm.wire.batch_views import BatchView
    from plateau.farm.wire.shot_views import ShotView

_FRAMES = ("frame", "job", "state", "spp", "asked for", "JOD then")


@app.command()
def show(
    job_id: o.OrJobId = None,
    batch: o.OrBatch = None,
    curve: Annotated[
        bool,
        typer.Option(
            "--curve",
            help="Of a job: print its curve, a line for each point; on a terminal, also draw it.",
        ),
    ] = False,
    as_csv: Annotated[
        bool, typer.Option("--csv", help="Of a job: print its curve as CSV.")
    ] = False,
    frames: Annotated[
        bool,
        typer.Option(
            "--frames", help="Of a shot: print its quality, and what each frame was given."
        ),
    ] = False,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Show a job or a batch: its state and the reason, its history, and the URLs of its images.

    For example:
      plateau show 3f9ac2d01b77
      plateau show 3f9ac2d01b77 --curve
      plateau show 3f9ac2d01b77 --csv > curve.csv
      plateau show --batch walk
      plateau show --batch walk --frames

    A shot is a batch that was submitted with --shot. Its quality is that of the video against the
    converged one, in JOD: 10 is the best, and at 9 three of four people prefer the converged one. A
    frame waits once its own rule is satisfied.
    """
    job_id = o.one_of(job_id, batch)
    if batch is not None and (curve or as_csv):
        raise typer.BadParameter("--curve and --csv show one job, not a batch")
    if batch is None and frames:
        raise typer.BadParameter("--frames shows a shot: give --batch NAME")
    if as_csv and as_json:
        raise typer.BadParameter("--csv and --json are two forms: choose one")
    with connect(url) as client:
        if batch is None:
            job_id = client.whole_id(job_id)
            if as_csv:
                print(client.curve_csv(job_id), end="")
            elif curve:
                _show_curve(client, job_id, as_json=as_json)
            else:
                _show_job(client, job_id, as_json=as_json)
        elif frames:
            _show_frames(client.shot(batch), as_json=as_json)
        else:
            found = client.batch(batch)
            print_one(found, batch_summary(found), as_json=as_json)


def _show_job(client: "Client", job_id: str, *, as_json: bool) -> None:
    from plateau.farm.model.job import utc_now
    from plateau.farm.wire import job_text
    from plateau.terminal.story import story

    job = client.job(job_id)
    lines = story(job_id, client.happened(job_id), client.log(job_id))
    if as_json:
        print(job.model_dump_json(indent=2))
        return
    print(job_text.row("job", f"{job.id} ({job.name})"))
    if job.owner is not None:
        print(job_text.row("owner", f"{job.owner_name} (key {job.owner})"))
    print(job_text.summary(job, utc_now()))
    print("story:")
    for line in lines:
        print(f"  {line}")
    for notice in job.notices:
        if notice.state != "delivered":
            print(job_text.row("notice", job_text.of_notice(notice)))
    print("links:")
    for name, path in job.links.items():
        print(f"  {name:<15}{client.url}{path}")


def _show_curve(client: "Client", job_id: str, *, as_json: bool) -> None:
    from rich.console import Console

    from plateau.farm.wire import job_text
    from plateau.terminal.curve import terminal_curve

    job, points = client.job(job_id), client.curve(job_id)
    if as_json:
        print_json(points)
        return
    if not points:
        first = f"the first comes at {job.spec.step:,} spp"
        print(f"the curve has no point yet: {first}", file=sys.stderr)
        return
    for point in points:
        print(job_text.point_line(job, point))
    console = Console()
    if console.is_terminal and console.encoding.startswith("utf"):
        console.print(
            terminal_curve(
                points, target=job.spec.rule.behaviour.noise_target, columns=console.width, rows=16
            )
        )


def batch_summary(batch: "BatchView") -> str:
    """A batch in a few lines."""
    from plateau.farm.wire import figures
    from plateau.farm.wire.job_text import row
    from plateau.terminal.batch_progress import in_states

    rows = [
        ("batch", f"{batch.name}, {batch.jobs:,} jobs: {in_states(batch.states)}"),
        ("samples", f"{_extent(batch.spp, figures.significant)} spp"),
        ("time", f"machine time {figures.duration(batch.machine_s)}"),
    ]
    if batch.held:
        rows.append(("held", f"{batch.held:,} of the queued jobs, until the batch is resumed"))
    if batch.samples_saved:
        rows.append(("saved", f"{batch.samples_saved:,} samples that the caps would have cost"))
    if batch.forecast_end_at is not None:
        rows.append(("ends", f"about {batch.forecast_end_at:%Y-%m-%d %H:%M:%S} UTC"))
    if batch.shot is not None:
        rows.append(("shot", _shot(batch.shot)))
    if batch.estimate_fraction is not None:
        left = _extent(batch.estimate_fraction, figures.percent)
        rows.append(("noise left", f"{left} of the pixels"))
    return "\n".join(row(name, text) for name, text in rows)


def _extent(extent: "Extent | None", said: Callable[[float], str]) -> str:
    if extent is None:
        return "–"
    least, most, mean = map(said, (extent.least, extent.most, extent.mean))
    return least if least == most else f"{least} to {most}, {mean} on average,"


def _shot(shot: "Shot") -> str:
    """A shot in a line."""
    words = f"{shot.frames:,} frames at {shot.fps:g} per second, {shot.state}"
    if shot.state in {"rendering", "judging"}:
        words += f": {shot.waiting:,} of them wait"
    if shot.jod is not None and shot.low_moment_jod is not None:
        words += f"; {shot.jod:.2f} JOD, at its worst moment {shot.low_moment_jod:.2f}"
        words += f" (frame {shot.worst_frame})"
    return words if shot.target is None else f"{words}; to be {shot.target:g}"


def _show_frames(shot: "ShotView", *, as_json: bool) -> None:
    from plateau.farm.wire.job_text import row
    from plateau.terminal.tables import print_rows

    if as_json:
        print(shot.model_dump_json(indent=2))
        return
    print(row("shot", _shot(shot)))
    if shot.why:
        print(row("judged", shot.why))
    print_rows(_FRAMES, _frames(shot), none="no frames")


def _frames(shot: "ShotView") -> list[tuple[str, ...]]:
    last = shot.judged[-1] if shot.judged else None
    return [
        (
            str(place),
            frame.job,
            "waits" if frame.waits else "deleted" if frame.state is None else frame.state.in_words,
            f"{frame.spp:,}",
            "" if frame.needs_spp is None else f"{frame.needs_spp:,}",
            "" if last is None else f"{last.low_frames[place]:.2f}",
        )
        for place, frame in enumerate(shot.by_frame)
    ]


@app.command()
def log(
    job_id: o.JobId,
    index: Annotated[
        int | None, typer.Option("--slice", metavar="N", help="Only this slice.", min=0)
    ] = None,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Show how each try of a slice ended, and what Mitsuba printed.

    For example:
      plateau log 3f9ac2d01b77 --slice 4
    """
    from plateau.terminal.story import log_lines

    with connect(url) as client:
        job_id = client.whole_id(job_id)
        entries = client.log(job_id, index=index)
    if as_json:
        print_json({"entries": [entry.model_dump(mode="json") for entry in entries]})
        return
    if not entries:
        print("nothing yet", file=sys.stderr)
    for line in log_lines(entries):
        print(line)
