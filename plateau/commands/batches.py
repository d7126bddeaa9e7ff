"""`plateau batches | batch`, and how a whole batch is submitted, watched and steered."""

import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Final

from rich.console import Console

from plateau.client import ApiError, Client
from plateau.commands import shots
from plateau.commands.connect import connect
from plateau.commands.outputs import write_results
from plateau.errors import CommandFailed, tell
from plateau.exit_codes import ExitCode
from plateau.farm.model.batch import Extent
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.wire import figures, job_text
from plateau.farm.wire.batch_views import BatchSteered, BatchView
from plateau.farm.wire.views import JobView
from plateau.files.frames import Values, each, from_file
from plateau.files.held import held
from plateau.files.job_folder import frame, require_free_for_batch
from plateau.files.out_folder import make, make_writable, ready
from plateau.files.out_pattern import OutPattern
from plateau.terminal.batch_progress import batch_progress_on, in_states
from plateau.terminal.tables import print_rows

_POLL_S: Final = 1.0
_COLUMNS: Final = ("batch", "jobs", "states", "newest (UTC)")

#: Writes what is to be had of some of a batch's jobs, by their places among all of them.
_Fetch = Callable[[Sequence[JobView], Sequence[int]], None]


def submit(
    scene: Path,
    spec: JobSpec,
    *,
    parameters: Path | None,
    definitions: list[str],
    zipped: bool,
    same_seeds: bool,
    url: str | None,
    as_json: bool,
) -> None:
    """Submit a scene once for each entry of the file, or each combination; prints the batch."""
    if parameters is not None and definitions:
        raise CommandFailed("--each and --parameters both list the jobs: give one of them")
    entries: list[Values]
    entries = each(definitions, zipped=zipped) if parameters is None else from_file(parameters)
    with connect(url) as client:
        batch = client.submit_batch(scene, entries, spec, same_seeds=same_seeds)
    print(batch.model_dump_json(indent=2) if as_json else batch.name)


def watch(name: str, out: Path | None, *, url: str | None, as_json: bool) -> int:
    """Follow a batch until all of its jobs are finished; returns the exit code.

    The results of each job are written when it finishes, into a folder named by its place in the
    batch; its image alone, where `out` is a pattern.
    """
    with connect(url) as client, ExitStack() as stack:
        fetch = None if out is None else stack.enter_context(_fetching(client, name, out))
        try:
            batch = _follow(client, name, fetch)
        except KeyboardInterrupt:
            tell(f"no longer watching; batch {name} continues")
            raise
    print(batch.model_dump_json(indent=2) if as_json else _summary(batch))
    return _exit_code(batch)


def _exit_code(batch: BatchView) -> ExitCode:
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
def _fetching(client: Client, name: str, out: Path) -> Iterator[_Fetch]:
    """Have what writes the results of a job; raises `CommandFailed` where it could not."""
    if OutPattern.is_one(str(out)):
        pattern = OutPattern(str(out))
        files = pattern.files(in_order(client, client.batch(name))).values()
        with ExitStack() as stack:
            # Who writes the same files has the same first and last one.
            for path in {*sorted(files)[:1], *sorted(files)[-1:]}:
                make(path.parent)
                stack.enter_context(held(path.with_name(f"{path.name}.batch")))
            yield partial(_write_images, client, pattern)
        return
    make_writable(out)
    with held(out):
        require_free_for_batch(out, client.batch(name).job_ids)
        yield partial(_write_folders, client, out)


def _follow(client: Client, name: str, fetch: _Fetch | None) -> BatchView:
    written: set[str] = set()
    with batch_progress_on(Console(stderr=True)) as show:
        while True:
            batch = client.batch(name)
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


def in_order(client: Client, batch: BatchView) -> list[JobView]:
    """Return the jobs of a batch in their order."""
    jobs = {job.id: job for job in client.all_jobs(batch=batch.name)}
    return [jobs[job_id] for job_id in batch.job_ids if job_id in jobs]


def _write_folders(
    client: Client, out: Path, jobs: Sequence[JobView], places: Sequence[int]
) -> None:
    """Write the results of finished jobs, unless an earlier command has written them."""
    for place in places:
        folder = frame(out, place, jobs[place].id)
        if not (folder / "summary.json").exists():  # the last file of a job
            with ready(folder):
                write_results(client, jobs[place], folder)


def _write_images(
    client: Client, pattern: OutPattern, jobs: Sequence[JobView], places: Sequence[int]
) -> None:
    """Write the images of finished jobs, but of those whose file a later job has, or without."""
    files = pattern.files(jobs)
    for job in (jobs[place] for place in places):
        path = files.get(job.id)
        if path is None:
            continue
        make(path.parent)
        try:
            client.download(job.id, pattern.image, path)
        except ApiError as error:
            if error.slug != "no-image-yet":
                raise
            tell(f"job {job.id} has no image, so there is no {path}")


def list_batches(*, limit: int, url: str | None, as_json: bool) -> None:
    """Print batches, those with the newest jobs first."""
    with connect(url) as client:
        found = [line for _, line in zip(range(limit), client.all_batches(), strict=False)]
    if as_json:
        print(json.dumps([line.model_dump(mode="json") for line in found], indent=2))
        return
    rows = [
        (line.name, str(line.jobs), in_states(line.states), f"{line.newest_at:%Y-%m-%d %H:%M:%S}")
        for line in found
    ]
    print_rows(_COLUMNS, rows, none="no batches", spare=("newest (UTC)",))


def show(name: str, *, url: str | None, as_json: bool) -> None:
    """Print the progress of a batch."""
    with connect(url) as client:
        batch = client.batch(name)
    print(batch.model_dump_json(indent=2) if as_json else _summary(batch))


def steer(name: str, action: str, *, url: str | None, as_json: bool) -> None:
    """Change all jobs of a batch, and print the outcome for each."""
    with connect(url) as client:
        calls = {
            "cancel": client.cancel_batch,
            "pause": client.pause_batch,
            "resume": client.resume_batch,
            "delete": client.delete_batch,
            "restore": client.restore_batch,
        }
        steered: BatchSteered = calls[action](name)
    if as_json:
        print(steered.model_dump_json(indent=2))
        return
    for one in steered.jobs:
        state = "" if one.state is None else f" {one.state.in_words}"
        print(f"{one.job}{state}" + (f" ({one.why_not})" if one.why_not else ""))


def _summary(batch: BatchView) -> str:
    """A batch in a few lines."""
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
        rows.append(("shot", shots.said(batch.shot)))
    if batch.estimate_fraction is not None:
        left = _extent(batch.estimate_fraction, figures.percent)
        rows.append(("noise left", f"{left} of the pixels"))
    return "\n".join(job_text.row(name, text) for name, text in rows)


def _extent(extent: Extent | None, said: Callable[[float], str]) -> str:
    if extent is None:
        return "–"
    least, most, mean = map(said, (extent.least, extent.most, extent.mean))
    return least if least == most else f"{least} to {most}, {mean} on average,"
