"""Routes that delete and restore ended jobs, one by one or a whole batch of them."""

from typing import Any, Final

from fastapi import APIRouter

from plateau.farm.wire.batch_views import BatchSteered, steered_view
from plateau.farm.wire.views import JobView
from plateau.service.api.access.callers import Caller, CallerOf
from plateau.service.api.http.parameters import BatchName
from plateau.service.api.parts import Farm, Parts
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import documented
from plateau.service.api.routes.jobs import JobId, shown

router = APIRouter(prefix="/v1")

_JOB: Final[dict[str, Any]] = {
    "status_code": 202,
    "tags": ["jobs"],
    "responses": documented(problems.UNKNOWN_JOB, problems.JOB_NOT_ENDED),
}
_BATCH: Final[dict[str, Any]] = {
    "status_code": 202,
    "tags": ["batches"],
    "responses": documented(problems.UNKNOWN_BATCH),
}


@router.delete("/jobs/{job_id}", **_JOB)
def delete_job(job_id: JobId, farm: Farm, who: CallerOf) -> JobView:
    """Delete an ended job: it leaves lists and its batch at once, and can be restored for a while.

    A sweep removes it with all its files after PLATEAU_KEEP_DELETED_DAYS, as soon as no other job
    continues it. Until then `GET` still shows it, with `deleted_at`. Repeating it is harmless; a
    job that has not ended answers 409: cancel it first.
    """
    return _set(job_id, farm, who, deleted=True)


@router.post("/jobs/{job_id}/restore", **_JOB)
def restore_job(job_id: JobId, farm: Farm, who: CallerOf) -> JobView:
    """Put a deleted job back into the list, and into its batch.

    Repeating it is harmless.
    """
    return _set(job_id, farm, who, deleted=False)


@router.delete("/batches/{name}", **_BATCH)
def delete_batch(name: BatchName, farm: Farm, who: CallerOf) -> BatchSteered:
    """Delete the jobs of a batch that have ended; without any job, the batch is no more.

    The answer says what became of each. Jobs of other keys are left alone. `restore` of the batch
    undoes it for a while.
    """
    return _set_batch(name, farm, who, deleted=True)


@router.post("/batches/{name}/restore", **_BATCH)
def restore_batch(name: BatchName, farm: Farm, who: CallerOf) -> BatchSteered:
    """Put the deleted jobs of a batch back into the list and the batch.

    The answer says what became of each. Jobs of other keys are left alone. Repeating it is
    harmless.
    """
    return _set_batch(name, farm, who, deleted=False)


def _set(job_id: str, farm: Parts, who: Caller, *, deleted: bool) -> JobView:
    farm.deletions.set(farm.job(job_id).id, deleted=deleted)
    return shown([farm.job(job_id)], farm, who)[0]


def _set_batch(name: str, farm: Parts, who: Caller, *, deleted: bool) -> BatchSteered:
    steered = farm.deletions.set_batch(name, deleted=deleted, may_touch=who.may_steer)
    return steered_view(name, steered)
