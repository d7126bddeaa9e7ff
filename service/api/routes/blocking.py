"""Routes that keep workers from a job's slices, and try a failed job again on others."""

import hashlib
from typing import Annotated, Any, Final

from fastapi import APIRouter, Path, Response

from plateau.farm.model.errors import JobNotEnded
from plateau.farm.model.place_names import MOST_BLOCKED, WorkerName
from plateau.farm.wire import examples
from plateau.farm.wire.views import JobView
from plateau.service.api.access.callers import CallerOf
from plateau.service.api.parts import Farm
from plateau.service.api.problems import problem as problems
from plateau.service.api.problems.problem import documented
from plateau.service.api.routes.jobs import JobId, shown
from plateau.service.api.submission import idempotency
from plateau.service.api.submission.idempotency import IdempotencyKey

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
#: Ends of tries for which the worker may be at fault.
_AT_FAULT: Final = frozenset({"died", "failed"})


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


@router.post(
    "/retry",
    status_code=201,
    openapi_extra={"parameters": idempotency.PARAMETERS},
    responses={
        201: {"headers": idempotency.NEW_JOB},
        **documented(
            problems.UNKNOWN_JOB,
            problems.JOB_NOT_ENDED,
            problems.TOO_MANY_JOBS,
            problems.TOO_MANY_NEEDS,
            problems.KEY_REUSED,
            problems.INVALID_REQUEST,
        ),
    },
)
def retry_job(
    job_id: JobId, response: Response, key: IdempotencyKey, farm: Farm, who: CallerOf
) -> JobView:
    """Try an ended job again on other workers, as a new job.

    The new job has the same scene and spec. The workers on which tries of the old one failed are
    blocked for it; `waits_for` says so where no other lives. It does not inherit the webhook, waits
    for no other job, and is no frame of a shot.
    """
    old = farm.job(job_id)
    if not old.state.ended:
        raise JobNotEnded(old.id, old.state.value)
    failed = {one.worker for one in farm.jobs.log(old.id) if one.what in _AT_FAULT}
    blocked = sorted({*old.spec.blocked, *failed})[:MOST_BLOCKED]
    changed = {"blocked": tuple(blocked), "webhook": None, "after": (), "shot": None}
    spec = old.spec.model_copy(update=changed)
    created = farm.jobs.create(
        spec,
        name=old.name,
        scene_sha256=old.scene_sha256,
        idempotency_key=key,
        digest=hashlib.sha256(f"retry {old.id}".encode()).hexdigest(),
        owner=who.id,
    )
    idempotency.settle(created, key, response)
    response.headers["Location"] = f"/v1/jobs/{created.job.id}"
    return shown([created.job], farm, who)[0]
