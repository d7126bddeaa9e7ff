"""`plateau submit | watch | show | log | list | cancel | again | …`: talk to a running service."""

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from rich.console import Console

from plateau.commands.connect import connect
from plateau.commands.follow import follow
from plateau.commands.outputs import write_results
from plateau.errors import CommandFailed, tell
from plateau.exit_codes import EXIT_CODES
from plateau.farm.model import input_errors
from plateau.farm.model.job import utc_now
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.spec.notice import NoticeSpec
from plateau.farm.model.states import JobState
from plateau.farm.wire import figures, job_text
from plateau.farm.wire.views import JobView
from plateau.files.out_folder import make_ready
from plateau.terminal.progress import progress_on
from plateau.terminal.story import log_lines, story
from plateau.terminal.tables import print_rows

_PAGE = 100
_WAITING = 5  #: most jobs without a fitting worker that are named
_COLUMNS = (
    *("id", "state", "spp", "noise left", "time", "to come", "created (UTC)"),
    *("by", "batch", "job"),
)
_SECRET = "PLATEAU_WEBHOOK_SECRET"
_SPARE = ("by", "created (UTC)", "batch", "time", "to come")  # on a narrow terminal


def submit(scene: Path, spec: JobSpec, *, url: str | None, as_json: bool) -> None:
    """Submit a scene; prints the job's id."""
    with connect(url) as client:
        job = client.submit(scene, spec)
    _print_id(job, as_json=as_json)
    if job.waits_for:
        tell(f"job {job.id} {job.waits_for}")
    elif job.time_left:
        tell(f"job {job.id} has {job.time_left}")


def with_notice(spec: JobSpec, told: Sequence[str]) -> JobSpec:
    """The spec with those who are told of the job's end: names of targets, and a URL."""
    if not told:
        return spec
    urls = [one for one in told if "/" in one]
    if len(urls) > 1:
        raise CommandFailed("--notify: a job has one URL")
    asked: dict[str, object] = {"targets": tuple(one for one in told if one not in urls)}
    if urls:
        asked |= {"url": urls[0], "secret": os.environ.get(_SECRET) or None}
    try:
        notice = NoticeSpec.model_validate(asked)
    except ValidationError as error:
        found = error.errors()[0]
        name = _SECRET if found["loc"][0] == "secret" else "--notify"
        raise CommandFailed(f"{name}: {input_errors.message(found)}") from None
    if notice.url is not None and notice.secret is None:
        raise CommandFailed(
            f"what is sent to {notice.url} has to be signed: export {_SECRET}=whsec_$(openssl rand "
            "-base64 32)"
        )
    return spec.model_copy(update={"notice": notice})


def watch(
    job_id: str, out: Path | None, *, url: str | None, as_json: bool, curve: bool = True
) -> int:
    """Follow a job to its end; returns the exit code."""
    shown = progress_on(Console(stderr=True), curve=curve)
    with connect(url) as client:
        job_id = client.whole_id(job_id)
        if out is not None:
            client.job(job_id)  # make no folder for an unknown job
            make_ready(out)
        try:
            job = follow(client, job_id, shown, lambda: None)
        except KeyboardInterrupt:
            tell(f"no longer watching; job {job_id} continues")
            raise
        if out is None:
            about = job_text.summary_json(job, client.curve(job_id), [])
        else:
            about = write_results(client, job, out)
    if as_json:
        print(json.dumps(about, indent=2))
    else:
        print(job_text.summary(job, utc_now()))
        if about["files"]:
            print(job_text.row("files", ", ".join(about["files"])))
    return EXIT_CODES[job.state]


def stream(job_id: str, *, url: str | None) -> int:
    """Print each event of a job as a line of JSON until its end; returns the exit code."""
    with connect(url) as client:
        job_id = client.whole_id(job_id)
        for event in client.events(job_id):
            print(event.model_dump_json(), flush=True)
        return EXIT_CODES[client.job(job_id).state]


def show(job_id: str, *, url: str | None, as_json: bool) -> None:
    """Print a job, its story and its links."""
    with connect(url) as client:
        job_id = client.whole_id(job_id)
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


def log(job_id: str, *, index: int | None, url: str | None, as_json: bool) -> None:
    """Print the log of a job, or of one of its slices."""
    with connect(url) as client:
        job_id = client.whole_id(job_id)
        entries = client.log(job_id, index=index)
    if as_json:
        lines = [entry.model_dump(mode="json") for entry in entries]
        print(json.dumps({"entries": lines}, indent=2))
        return
    if not entries:
        print("nothing yet", file=sys.stderr)
    for line in log_lines(entries):
        print(line)


def list_jobs(
    *,
    state: str | None,
    batch: str | None,
    owner: str | None,
    search: str | None,
    deleted: bool,
    limit: int,
    url: str | None,
    as_json: bool,
) -> None:
    """Print jobs, newest first."""
    jobs: list[JobView] = []
    cursor = None
    with connect(url) as client:
        while len(jobs) < limit:
            page = client.jobs(
                state=_state(state),
                batch=batch,
                owner=owner,
                search=search,
                deleted=deleted,
                cursor=cursor,
                limit=min(limit - len(jobs), _PAGE),
            )
            jobs += page.jobs
            cursor = page.next_cursor
            if cursor is None:
                break
    if as_json:
        print(json.dumps([job.model_dump(mode="json") for job in jobs], indent=2))
    else:
        print_rows(_COLUMNS, list(map(_row, jobs)), none="no jobs", spare=_SPARE)
        _warn_of_waiting([job for job in jobs if job.waits_for])


def steer(job_id: str, action: str, *, url: str | None, as_json: bool) -> None:
    """Cancel, pause or resume a job that renders; delete or restore one that has ended."""
    with connect(url) as client:
        calls = {
            "cancel": client.cancel,
            "pause": client.pause,
            "resume": client.resume,
            "delete": client.delete,
            "restore": client.restore,
        }
        job = calls[action](client.whole_id(job_id))
    shown = f"{job.id} {job.outcome}{', deleted' if job.deleted_at else ''}"
    print(job.model_dump_json(indent=2) if as_json else shown)


def priority(job_id: str, value: int, *, url: str | None, as_json: bool) -> None:
    """Change a job's priority."""
    with connect(url) as client:
        job = client.set_priority(client.whole_id(job_id), value)
    shown = f"{job.id} {job.state.value}, priority {job.spec.priority}"
    print(job.model_dump_json(indent=2) if as_json else shown)


def _state(name: str | None) -> JobState | None:
    try:
        return None if name is None else JobState(name)
    except ValueError:
        states = ", ".join(state.value for state in JobState)
        raise CommandFailed(f"there is no state {name!r}; the states are {states}") from None


def _warn_of_waiting(jobs: Sequence[JobView]) -> None:
    """Name on standard error the jobs that wait for others, or that no worker can render."""
    for job in jobs[:_WAITING]:
        tell(f"job {job.id} {job.waits_for}")
    if len(jobs) > _WAITING:
        tell(f"and {len(jobs) - _WAITING} others wait too")


def _row(job: JobView) -> tuple[str, ...]:
    left = "–" if job.estimate_fraction is None else figures.percent(job.estimate_fraction)
    return (
        job.id,
        job.outcome,
        f"{job.spp}/{job.spec.max_spp}",
        left,
        figures.duration(job.duration_s(utc_now())),
        job.time_left or "–",
        f"{job.created_at:%Y-%m-%d %H:%M:%S}",
        job.owner_name or "–",
        job.spec.batch or "–",
        job.title,
    )


def again(job_id: str, changes: dict[str, Any], *, url: str | None, as_json: bool) -> None:
    """Render an ended job again; prints the new job's id, and what it keeps of the old one."""
    with connect(url) as client:
        job = client.again(client.whole_id(job_id), **changes)
    _print_id(job, as_json=as_json)
    tell(f"job {job.id} {job_text.again(job)}")
    if job.waits_for:
        tell(f"job {job.id} {job.waits_for}")


def _print_id(job: JobView, *, as_json: bool) -> None:
    print(job.model_dump_json(indent=2) if as_json else job.id)
