"""Routes that show, list and steer jobs."""

from typing import Annotated, Any, Final, Literal

from fastapi import APIRouter, Path, Query
from pydantic import Field
from pydantic.json_schema import SkipJsonSchema

from plateau.farm.model.fit import Crew, waits_for
from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from plateau.farm.wire import examples
from plateau.farm.wire.views import (
    JobChange,
    JobPage,
    JobView,
    Log,
    Slices,
    SliceView,
    job_view,
)
from plateau.service.api.access.callers import Caller, CallerOf
from plateau.service.api.http.parameters import Cursor, cursor_of, number_of
from plateau.service.api.parts import Farm, Parts
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import documented
from plateau.service.api.problems.problem import Problem, ProblemType

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])


def shown(jobs: list[Job], farm: Parts, who: Caller) -> list[JobView]:
    """The jobs as the caller sees them, with their places in the queue and what they wait for."""
    crew = Crew([] if all(job.state.ended for job in jobs) else farm.workers.living())
    queued = [job for job in jobs if job.state is JobState.QUEUED]
    in_line = {job.id for job in queued if not (job.held or job.awaits)}
    places = farm.jobs.places() if in_line else {}

    def view(job: Job) -> JobView:
        return job_view(
            job,
            to_owner=who.made(job.owner),
            queue_place=places.get(job.id) if job.id in in_line else None,
            fitting_workers=None if job.state.ended else crew.fitting(job),
            waits_for=waits_for(job, crew),
        )

    return list(map(view, jobs))


#: Whether jobs have a property; ``any`` if that does not matter.
Whether = Literal["false", "true", "any"]
_WHETHER: Final[dict[Whether, bool | None]] = {"false": False, "true": True, "any": None}

JobId = Annotated[str, Path(description="the job's `id`", examples=[examples.JOB_ID])]


def _steering(refusal: ProblemType) -> dict[str, Any]:
    """What FastAPI is told of a route that moves a job to another state."""
    return {"status_code": 202, "responses": documented(problems.UNKNOWN_JOB, refusal)}


@router.get("", responses=documented(problems.INVALID_REQUEST))
def list_jobs(
    farm: Farm,
    who: CallerOf,
    state: Annotated[
        JobState | None, Query(description="only jobs in this state", examples=["rendering"])
    ] = None,
    batch: Annotated[
        str | None, Query(description="only jobs of this batch", examples=["exposures"])
    ] = None,
    owner: Annotated[
        str | None,
        Query(
            pattern="^[0-9a-f]{12}$",
            description="only jobs that this API key made, by its id",
            examples=[examples.KEY_ID],
        ),
    ] = None,
    search: Annotated[
        str,
        Query(
            max_length=200,
            description="only jobs in which each of these words occurs: in the id, the name, the "
            "batch, the owner's name or a tag that workers must have",
            examples=["dusk frame"],
        ),
    ] = "",
    deleted: Annotated[
        Whether,
        Query(
            description="leave deleted jobs out, or list only those, or both; they can be restored",
            examples=["true"],
        ),
    ] = "false",
    cursor: Cursor = None,
    limit: Annotated[
        int, Query(ge=1, le=200, description="most jobs on the page", examples=[20])
    ] = 50,
) -> JobPage:
    """List jobs, newest first.

    A search, and a filter by several fields, read the stored jobs until the page is full.
    """
    before = number_of(cursor)
    found, after = farm.jobs.search(
        state=state,
        batch=batch,
        owner=owner,
        search=search,
        deleted=_WHETHER[deleted],
        before=before,
        limit=limit,
    )
    return JobPage(jobs=shown(found, farm, who), next_cursor=cursor_of(after))


@router.get("/{job_id}", responses=documented(problems.UNKNOWN_JOB))
def get_job(job_id: JobId, farm: Farm, who: CallerOf) -> JobView:
    """Show a job: its state, the reason for it, what is merged, and the noise left."""
    return shown([farm.job(job_id)], farm, who)[0]


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
def change_job(job_id: JobId, asked: JobChange, farm: Farm, who: CallerOf) -> JobView:
    """Change a job's priority, which is part of its `spec`.

    It counts from the next slice that a worker takes. A job that has ended answers 409 with its
    state.
    """
    return shown([farm.jobs.set_priority(farm.job(job_id).id, asked.priority)], farm, who)[0]


@router.post("/{job_id}/cancel", **_steering(problems.CANNOT_CANCEL))
def cancel_job(job_id: JobId, farm: Farm, who: CallerOf) -> JobView:
    """Cancel a job. Its state changes at once; workers stop within a pass, about a second.

    The job keeps the image merged by then. Cancelling it again is harmless; a job that ended
    otherwise answers 409 with its state.
    """
    job = farm.jobs.cancel(farm.job(job_id).id, f"cancelled by {who.name}")
    return job_view(job, to_owner=who.made(job.owner))


@router.post("/{job_id}/pause", **_steering(problems.CANNOT_PAUSE))
def pause_job(job_id: JobId, farm: Farm, who: CallerOf) -> JobView:
    """Pause a rendering job: workers take no more slices of it, and its time limit stops counting.

    Slices under way are finished, merged and judged, so the job may still converge or reach its
    cap. Pausing it again is harmless; a job that waits for its first slice, or has ended, answers
    409 with its state.
    """
    job = farm.jobs.pause(farm.job(job_id).id, f"paused by {who.name}")
    return job_view(job, to_owner=who.made(job.owner))


@router.post("/{job_id}/resume", **_steering(problems.CANNOT_RESUME))
def resume_job(job_id: JobId, farm: Farm, who: CallerOf) -> JobView:
    """Resume a paused job; its image and curve become those of a job that was never paused.

    Resuming a job that is rendering is harmless; one that waits for its first slice, or has ended,
    answers 409 with its state.
    """
    return shown([farm.jobs.resume(farm.job(job_id).id, f"resumed by {who.name}")], farm, who)[0]


@router.get("/{job_id}/slices", responses=documented(problems.UNKNOWN_JOB))
def list_slices(job_id: JobId, farm: Farm) -> Slices:
    """Show the ledger: each committed slice with its seeds, worker and time."""
    ledger = farm.jobs.ledger(farm.job(job_id).id)
    return Slices(slices=[SliceView(**record) for record in ledger.values()])


@router.get(
    "/{job_id}/log",
    responses=documented(problems.UNKNOWN_JOB, problems.UNKNOWN_SLICE, problems.INVALID_REQUEST),
)
def get_job_log(
    job_id: JobId,
    farm: Farm,
    index: Annotated[
        Annotated[int, Field(ge=0, le=10**9)] | SkipJsonSchema[None],  # no query has a null
        Query(alias="slice", description="only tries of this slice", examples=[15]),
    ] = None,
) -> Log:
    """Show how each try of a slice ended, and what Mitsuba printed, by time.

    Of tries with more to report than their record in the ledger, about the newest 2000.
    """
    job = farm.job(job_id)
    plan = farm.jobs.plan(job)
    if index is not None and index >= plan.stop:
        kind = problems.BEYOND_THE_CAP if plan.is_complete else problems.BEYOND_THE_PLAN
        raise Problem(kind, job=job.id, index=index, slices=plan.stop)
    return Log(entries=farm.jobs.log(job.id, index))
