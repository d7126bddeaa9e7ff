"""Routes that create, show, list and steer jobs."""

from typing import Annotated, Any

from fastapi import APIRouter, Depends, Path, Query, Response

from farm.states import JobState
from service import examples, problems
from service.parts import Parts, parts
from service.problems import Problem, documented
from service.uploads import Submission, create_job, submission
from service.views import JobChange, JobPage, JobView, Log, SliceLog, Slices, SliceView, job_view

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])

JobId = Annotated[str, Path(description="the job's `id`", examples=[examples.JOB_ID])]

_SUBMISSION: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            "multipart/form-data": {
                "schema": {
                    "type": "object",
                    "properties": {
                        "scene": {
                            "type": "string",
                            "format": "binary",
                            "description": "a Mitsuba 3 XML, or a zip of one with its meshes and "
                            "textures",
                        },
                        "scene_sha256": {
                            "type": "string",
                            "pattern": "^([0-9a-f]{64})?$",
                            "description": "instead of `scene`: one that is already stored; "
                            "empty, as a web form sends it, it counts as left out",
                        },
                        "spec": {"$ref": "#/components/schemas/JobSpec"},
                    },
                    "anyOf": [{"required": ["scene"]}, {"required": ["scene_sha256"]}],
                    "additionalProperties": False,
                },
                "examples": {
                    "an upload": {"value": {"scene": examples.SCENE_XML, "spec": examples.SPEC}},
                    "a stored scene": {
                        "value": {"scene_sha256": examples.SCENE_SHA256, "spec": {}}
                    },
                },
                "encoding": {"spec": {"contentType": "application/json"}},
            }
        },
    },
    "parameters": [
        {
            "name": "Idempotency-Key",
            "in": "header",
            "required": False,
            "schema": {"type": "string", "pattern": "^[\\x21-\\x7e]{1,255}$"},
            "example": examples.IDEMPOTENCY_KEY,
            "description": "a request repeated with the same key within a day makes one job",
        }
    ],
}


@router.post(
    "",
    status_code=201,
    openapi_extra=_SUBMISSION,
    responses={
        201: {
            "headers": {
                "Location": {"schema": {"type": "string"}, "description": "path of the job"},
                "Idempotency-Replayed": {
                    "schema": {"const": "true"},
                    "description": "only where the key's first request had made the job",
                },
            }
        },
        **documented(
            problems.MALFORMED_REQUEST,
            problems.UPLOAD_TOO_LARGE,
            problems.NOT_MULTIPART,
            problems.INVALID_REQUEST,
            problems.INVALID_SPEC,
            problems.NO_SCENE,
            problems.UNKNOWN_SCENE,
            problems.BROKEN_SCENE,
            problems.KEY_REUSED,
        ),
    },
)
def submit(
    response: Response,
    asked: Annotated[Submission, Depends(submission)],
    farm: Annotated[Parts, Depends(parts)],
) -> JobView:
    """Submit a scene: it is checked, stored once, and queued as a new job.

    `spec` may be left out, as may any of its fields. Answers 201 with the job; the header
    `Idempotency-Replayed: true` says that the key's first request had made it already.
    """
    created = create_job(asked, farm.jobs, farm.blobs, farm.limits)
    response.headers["Location"] = f"/v1/jobs/{created.job.id}"
    if created.repeated:
        response.headers["Idempotency-Replayed"] = "true"
    return job_view(created.job)


@router.get("", responses=documented(problems.INVALID_REQUEST))
def page(
    farm: Annotated[Parts, Depends(parts)],
    state: Annotated[
        JobState | None, Query(description="only jobs in this state", examples=["rendering"])
    ] = None,
    batch: Annotated[
        str | None, Query(description="only jobs of this batch", examples=["exposures"])
    ] = None,
    cursor: Annotated[
        str | None,
        Query(
            pattern="^[0-9]{1,15}$",
            description="`next_cursor` of the page before",
            examples=["42"],
        ),
    ] = None,
    limit: Annotated[
        int, Query(ge=1, le=200, description="most jobs on the page", examples=[20])
    ] = 50,
) -> JobPage:
    """List jobs, newest first."""
    before = None if cursor is None else int(cursor)
    found, after = farm.jobs.search(state=state, batch=batch, before=before, limit=limit)
    return JobPage(
        jobs=[job_view(job) for job in found], next_cursor=None if after is None else str(after)
    )


@router.get("/{job_id}", responses=documented(problems.UNKNOWN_JOB))
def show(job_id: JobId, farm: Annotated[Parts, Depends(parts)]) -> JobView:
    """Show a job: its state and why, what is merged, and what the eye would see of the rest."""
    return job_view(farm.job(job_id))


@router.patch(
    "/{job_id}",
    responses=documented(
        problems.MALFORMED_REQUEST,
        problems.UNKNOWN_JOB,
        problems.JOB_ENDED,
        problems.UPLOAD_TOO_LARGE,
        problems.INVALID_REQUEST,
    ),
)
def change(job_id: JobId, asked: JobChange, farm: Annotated[Parts, Depends(parts)]) -> JobView:
    """Change a job's priority, which is part of its `spec` then.

    It counts from the next slice that a worker takes; nobody stops in the middle of one. A job that
    has ended answers 409 with its state.
    """
    return job_view(farm.jobs.set_priority(farm.job(job_id).id, asked.priority))


@router.post(
    "/{job_id}/cancel",
    status_code=202,
    responses=documented(problems.UNKNOWN_JOB, problems.CANNOT_CANCEL),
)
def cancel(job_id: JobId, farm: Annotated[Parts, Depends(parts)]) -> JobView:
    """Cancel a job. Its state changes at once; workers stop within a pass, about a second.

    What is merged by then is kept and written as its image. Cancelling it again is harmless; a
    job that ended otherwise answers 409 with its state.
    """
    return job_view(farm.jobs.cancel(farm.job(job_id).id))


@router.post(
    "/{job_id}/pause",
    status_code=202,
    responses=documented(problems.UNKNOWN_JOB, problems.CANNOT_PAUSE),
)
def pause(job_id: JobId, farm: Annotated[Parts, Depends(parts)]) -> JobView:
    """Pause a rendering job: workers take no more slices of it, and its time limit stands still.

    The slices that they are rendering are finished, merged and judged, so the job may yet converge
    or reach its cap. Pausing it again is harmless; a job that waits for its first slice, or has
    ended, answers 409 with its state.
    """
    return job_view(farm.jobs.pause(farm.job(job_id).id))


@router.post(
    "/{job_id}/resume",
    status_code=202,
    responses=documented(problems.UNKNOWN_JOB, problems.CANNOT_RESUME),
)
def resume(job_id: JobId, farm: Annotated[Parts, Depends(parts)]) -> JobView:
    """Let a paused job go on where it stood: its image and curve are those of one never paused.

    Resuming a job that is rendering is harmless; one that waits for its first slice, or has ended,
    answers 409 with its state.
    """
    return job_view(farm.jobs.resume(farm.job(job_id).id))


@router.get("/{job_id}/slices", responses=documented(problems.UNKNOWN_JOB))
def slices(job_id: JobId, farm: Annotated[Parts, Depends(parts)]) -> Slices:
    """Show the ledger: each committed slice with its seeds, its worker and its time."""
    ledger = farm.jobs.ledger(farm.job(job_id).id)
    return Slices(slices=[SliceView(**record) for record in ledger.values()])


@router.get("/{job_id}/log", responses=documented(problems.UNKNOWN_JOB))
def log(job_id: JobId, farm: Annotated[Parts, Depends(parts)]) -> Log:
    """Show how each try of a slice ended, and what Mitsuba printed meanwhile.

    By time. Of tries that left more to say than their line in the ledger, the newest 2000 or so.
    """
    return Log(entries=farm.jobs.log(farm.job(job_id).id))


@router.get(
    "/{job_id}/slices/{index}/log",
    responses=documented(problems.UNKNOWN_JOB, problems.UNKNOWN_SLICE, problems.INVALID_REQUEST),
)
def one_slice_log(
    job_id: JobId,
    index: Annotated[int, Path(ge=0, description="the slice's index", examples=[15])],
    farm: Annotated[Parts, Depends(parts)],
) -> SliceLog:
    """Show the log of one slice, with its line in the ledger."""
    job = farm.job(job_id)
    if index >= job.spec.max_slices:
        raise Problem(
            problems.UNKNOWN_SLICE,
            f"job {job.id} has no slice {index}: at its cap it has {job.spec.max_slices}",
        )
    record, entries = farm.jobs.log_of(job.id, index)
    return SliceLog(slice=None if record is None else SliceView(**record), entries=entries)
