"""Routes that send all that jobs have come to as one zip."""

from collections.abc import Iterable, Iterator
from itertools import chain
from typing import Annotated, Final

from fastapi import APIRouter, Query, Response
from fastapi.responses import StreamingResponse
from pydantic.json_schema import SkipJsonSchema

from plateau.farm.model.job import Job
from plateau.farm.wire import examples
from plateau.service.api.http.served_blobs import file_of
from plateau.service.api.parts import Farm, Parts
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import documented
from plateau.service.api.problems.problem import Problem
from plateau.service.api.results.job_files import JobFiles
from plateau.service.api.results.zip_stream import ZipEntry, zipped
from plateau.service.api.routes.jobs import JobId

router = APIRouter(prefix="/v1", tags=["results"])

_ZIP: Final = "application/zip"
_FILE: Final = file_of(_ZIP, "Cache-Control", "Content-Disposition")
#: Jobs of one request, which a URL can name.
_MOST_JOBS: Final = 200


class _ZipResponse(StreamingResponse):
    media_type = _ZIP


@router.get(
    "/jobs/{job_id}/results.zip",
    response_class=_ZipResponse,
    responses={**_FILE, **documented(problems.UNKNOWN_JOB)},
)
def get_results_zip(job_id: JobId, farm: Farm) -> Response:
    """Fetch everything that a job has come to as one zip: images, maps, previews, curve.

    They have the names that the job's own paths have, and `summary.json` has the job itself. Images
    and maps are of the same samples. Slices are left out, and so are files that are damaged;
    `damaged.txt` then names these.
    """
    job = farm.job(job_id)
    return _sent(JobFiles(farm, job).entries(), f"{job.id}-results.zip")


@router.get(
    "/results.zip",
    response_class=_ZipResponse,
    responses={
        **_FILE,
        **documented(problems.UNKNOWN_JOB, problems.UNKNOWN_BATCH, problems.INVALID_REQUEST),
    },
)
def get_results_of_jobs(
    farm: Farm,
    job: Annotated[
        list[str],
        Query(max_length=_MOST_JOBS, description="the jobs' ids", examples=[[examples.JOB_ID]]),
    ] = [],  # noqa: B006  (FastAPI copies it)
    batch: Annotated[
        str | SkipJsonSchema[None],  # no query has a null
        Query(description="the batch whose jobs are fetched, too", examples=["exposures"]),
    ] = None,
) -> Response:
    """Fetch everything that several jobs have come to as one zip, with a folder for each job.

    The folders' names begin with the jobs' places in the batch, or in the request.
    """
    ids = [*job, *(farm.batches.get(batch).job_ids if batch is not None else ())]
    if not ids:
        raise Problem(problems.NO_JOBS_NAMED)
    return _sent(_in_folders(farm, [farm.job(one) for one in ids]), "results.zip")


def _in_folders(farm: Parts, jobs: Iterable[Job]) -> Iterator[ZipEntry]:
    for place, job in enumerate(jobs):
        yield from JobFiles(farm, job, f"{place:04d}-{job.id}/").entries()


def _sent(entries: Iterator[ZipEntry], name: str) -> Response:
    chunks = zipped(entries)
    # The first is made before the headers are sent, so that what is away can be said.
    content = chain([next(chunks)], chunks)
    headers = {
        "Cache-Control": "no-store",
        "Content-Disposition": f'attachment; filename="{name}"',
    }
    return _ZipResponse(content, headers=headers)
