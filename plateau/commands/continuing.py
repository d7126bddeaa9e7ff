"""`plateau continue | rejudge`: go on with a job that has ended."""

from typing import Any

from plateau.commands.connect import connect
from plateau.commands.job_ids import whole_id
from plateau.farm.wire.views import JobView


def continue_job(job_id: str, changes: dict[str, Any], *, url: str | None, as_json: bool) -> None:
    """Go on with an ended job; prints the new job's id."""
    with connect(url) as client:
        _print(client.continue_job(whole_id(client, job_id), changes), as_json=as_json)


def rejudge(job_id: str, changes: dict[str, Any], *, url: str | None, as_json: bool) -> None:
    """Judge the kept slices of an ended job again; prints the new job's id."""
    with connect(url) as client:
        _print(client.rejudge(whole_id(client, job_id), changes), as_json=as_json)


def _print(job: JobView, *, as_json: bool) -> None:
    print(job.model_dump_json(indent=2) if as_json else job.id)
