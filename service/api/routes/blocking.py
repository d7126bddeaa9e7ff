"""Routes that keep workers from a job's slices."""

from typing import Annotated, Any, Final

from fastapi import APIRouter, Path

from plateau.farm.model.place_names import WorkerName
from plateau.farm.wire import examples
from plateau.farm.wire.views import JobView
from plateau.service.api.access.callers import CallerOf
from plateau.service.api.parts import Farm
from plateau.service.api.problems import problem as problems
from plateau.service.api.problems.problem import documented
from plateau.service.api.routes.jobs import JobId, shown

router = APIRouter(prefix="/v1/jobs/{job_id}", tags=["jobs"])

_Worker = Annotated[
    WorkerName,
    Path(
        description="a worker's `id`, or the `host` of all workers of a machine",
        examples=[examples.WORKER["id"]],
    ),
]
_BLOCK: Final[dict[str, Any]] = {
    "status_code": 202,
    "responses": documented(
        problems.UNKNOWN_JOB,
        problems.JOB_ENDED,
        problems.TOO_MANY_BLOCKED,
        problems.TOO_MANY_NEEDS,
        problems.INVALID_REQUEST,
    ),
}


@router.put("/blocked/{worker}", **_BLOCK)
def block_worker(job_id: JobId, worker: _Worker, farm: Farm, who: CallerOf) -> JobView:
    """Keep a worker, or a machine, from the job's slices; others render them.

    It finishes the slice that it has, and serves other jobs. Repeating it is harmless. A worker
    that is restarted has another id, a machine keeps its name.
    """
    return shown([farm.jobs.block(farm.job(job_id).id, worker)], farm, who)[0]


@router.delete("/blocked/{worker}", **_BLOCK)
def unblock_worker(job_id: JobId, worker: _Worker, farm: Farm, who: CallerOf) -> JobView:
    """Let a blocked worker render the job's slices again; harmless for others."""
    return shown([farm.jobs.block(farm.job(job_id).id, worker, undo=True)], farm, who)[0]
