"""`plateau watch`: a job or a batch to its end, with its results."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.commands.connect import connect
from plateau.commands.printing import print_json, print_one
from plateau.commands.show import batch_summary
from plateau.errors import EXIT_CODES, ExitCode, tell
from plateau.farm.model.states import JobState

if TYPE_CHECKING:
    from plateau.client import Client
    from plateau.farm.wire.batch_views import BatchView
    from plateau.farm.wire.views import JobView

_POLL_S: Final = 1.0


@app.command()
def watch(
    job_id: o.OrJobId = None,
    batch: o.OrBatch = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="DIR",
            help="Folder for the results; of a batch, each job has a folder in it.",
        ),
    ] = None,
    no_curve: o.NoCurve = False,
    events: Annotated[
        bool, typer.Option("--events", help="Print each event as a line of JSON, and nothing else.")
    ] = False,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Watch a job or a batch until it ends; the exit code says how it ended.

    For example:
      plateau watch 3f9ac2d01b77 -o out
      plateau watch --batch walk -o frames
      plateau watch 3f9ac2d01b77 --events | jq 'select(.type == "point") | .data.visible_pixels'

    On a terminal the curve is drawn as it grows. Ctrl-C stops watching; the job continues. --json
    prints the summary at the end. The exit code is 3 if jobs of the batch ended before their rule
    stopped them.
    """
    if events and (out is not None or as_json):
        raise typer.BadParameter("--events cannot be combined with --out or --json")
    if events and batch is not None:
        raise typer.BadParameter("--events shows one job, not a batch")
    job = o.one_of(job_id, batch)
    with connect(url) as client:
        if batch is not None:
            ended = _batch(client, batch, out)
            print_one(ended, batch_summary(ended), as_json=as_json)
            raise typer.Exit(_exit_code(ended))
        job = client.whole_id(job)
        if events:
            for event in client.events(job):
                print(event.model_dump_json(), flush=True)
            raise typer.Exit(EXIT_CODES[client.job(job).state])
        _job(client, job, out, as_json=as_json, curve=not no_curve)


def _job(client: "Client", job_id: str, out: Path | None, *, as_json: bool, curve: bool) -> None:
    """Follow a job to its end, write its results and print its summary."""
    from rich.console import Console

    from plateau.farm.model.job import utc_now
    from plateau.farm.wire import job_text
    from plateau.files.out_folder import ready
    from plateau.rendering.follow import follow
    from plateau.rendering.outputs import write_results
    from plateau.terminal.progress import progress_on

    shown = progress_on(Console(stderr=True), curve=curve)
    with ExitStack() as stack:
        if out is not None:
            client.job(job_id)  # make no folder for an unknown job
            stack.enter_context(ready(out))
        try:
            job = follow(client, job_id, shown, lambda _: None)
        except KeyboardInterrupt:
            tell(f"no longer watching; job {job_id} continues")
            raise
        if out is None:
            about = job_text.summary_json(job, client.curve(job_id), [])
        else:
            about = write_results(client, job, out)
    if as_json:
        print_json(about)
    else:
        print(job_text.summary(job, utc_now()))
        if about["files"]:
            print(job_text.row("files", ", ".join(about["files"])))
    raise typer.Exit(EXIT_CODES[job.state])


def _batch(client: "Client", name: str, out: Path | None) -> "BatchView":
    """Follow a batch until all of its jobs are finished.

    The results of each job are written when it finishes, into a folder named by its place in the
    batch; its image alone, where `out` is a pattern.
    """
    from rich.console import Console

    from plateau.terminal.batch_progress import batch_progress_on

    written: set[str] = set()
    try:
        with ExitStack() as stack, batch_progress_on(Console(stderr=True)) as show:
            fetch = None if out is None else stack.enter_context(_fetching(client, name, out))
            while True:
                batch = client.batch(name)
                written &= set(batch.job_ids)  # others were deleted
                show(batch)
                if fetch is not None and batch.finished > len(written):
                    jobs = in_order(client, batch)
                    new = [
                        place
                        for place, job in enumerate(jobs)
                        if job.finished_at is not None and job.id not in written
                    ]
                    fetch(jobs, new)
                    written.update(jobs[place].id for place in new)
                if batch.finished == batch.jobs and (fetch is None or len(written) == batch.jobs):
                    return batch
                time.sleep(_POLL_S)
    except KeyboardInterrupt:
        tell(f"no longer watching; batch {name} continues")
        raise


def _exit_code(batch: "BatchView") -> ExitCode:
    """The exit code for the worst end of a job of the batch.

    A single image that its cap ended is a success. In a batch it is a frame that is noisier than
    its neighbours: the sequence flickers.
    """
    if JobState.FAILED in batch.states:
        return ExitCode.FAILED
    if JobState.CANCELLED in batch.states:
        return ExitCode.CANCELLED
    return ExitCode.MISSED if JobState.EXHAUSTED in batch.states else ExitCode.OK


@contextmanager
def _fetching(
    client: "Client", name: str, out: Path
) -> Iterator[Callable[[Sequence["JobView"], Sequence[int]], None]]:
    """Have what writes the results of some of a batch's jobs, by their places among all.

    Raises `CommandFailed` where it could not. Nobody else writes there meanwhile.
    """
    from plateau.files.held import held
    from plateau.files.job_folder import require_free_for_batch
    from plateau.files.out_folder import make_writable

    make_writable(out)
    with held(out):
        require_free_for_batch(out, client.batch(name).job_ids)
        yield partial(_write_folders, client, out)


def in_order(client: "Client", batch: "BatchView") -> "list[JobView]":
    """Return the jobs of a batch in their order."""
    jobs = {job.id: job for job in client.all_jobs(batch=batch.name)}
    return [jobs[job_id] for job_id in batch.job_ids if job_id in jobs]


def _write_folders(
    client: "Client", out: Path, jobs: Sequence["JobView"], places: Sequence[int]
) -> None:
    """Write the results of finished jobs, unless an earlier command has written them."""
    from plateau.files.job_folder import frame
    from plateau.files.out_folder import ready
    from plateau.rendering.outputs import write_results

    for place in places:
        folder = frame(out, place, jobs[place].id)
        if not (folder / "summary.json").exists():  # the last file of a job
            with ready(folder):
                write_results(client, jobs[place], folder)
