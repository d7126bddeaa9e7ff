"""Routes that archive, delete and restore ended jobs, alone or a whole batch of them."""

from typing import Any, Final

from fastapi import APIRouter

from plateau.farm.model.states import Visibility
from plateau.farm.wire.batch_views import BatchSteered, steered_view
from plateau.farm.wire.views import JobView
from plateau.service.api.access.callers import Caller, CallerOf
from plateau.service.api.http.parameters import BatchName
from plateau.service.api.parts import Farm, Parts
from plateau.service.api.problems import problem as problems
from plateau.service.api.problems.problem import documented
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


@router.post("/jobs/{job_id}/archive", **_JOB)
def archive_job(job_id: JobId, farm: Farm, who: CallerOf) -> JobView:
    """Archive an ended job: lists leave it out unless they are asked for archived ones.

    It stays as it is otherwise, and in its batch. Repeating it is harmless.
    """
    return _filed(job_id, Visibility.ARCHIVED, farm, who)


@router.delete("/jobs/{job_id}", **_JOB)
def delete_job(job_id: JobId, farm: Farm, who: CallerOf) -> JobView:
    """Delete an ended job: it leaves lists and its batch at once, and can be restored for a while.

    A sweep removes it with all its files after PLATEAU_KEEP_DELETED_DAYS, as soon as no other job
    continues it. Until then `GET` still shows it, with `deleted_at`. Repeating it is harmless; a
    job that has not ended answers 409: cancel it first.
    """
    return _filed(job_id, Visibility.DELETED, farm, who)


@router.post("/jobs/{job_id}/restore", **_JOB)
def restore_job(job_id: JobId, farm: Farm, who: CallerOf) -> JobView:
    """Put an archived or deleted job back into the list, and into its batch.

    Repeating it is harmless.
    """
    return _filed(job_id, Visibility.LISTED, farm, who)


@router.post("/batches/{name}/archive", **_BATCH)
def archive_batch(name: BatchName, farm: Farm, who: CallerOf) -> BatchSteered:
    """Archive the jobs of a batch that have ended; the batch itself stays.

    The answer says what became of each. Jobs of other keys are left alone. Repeating it is
    harmless.
    """
    return _filed_batch(name, Visibility.ARCHIVED, farm, who)


@router.delete("/batches/{name}", **_BATCH)
def delete_batch(name: BatchName, farm: Farm, who: CallerOf) -> BatchSteered:
    """Delete the jobs of a batch that have ended; without any job, the batch is no more.

    The answer says what became of each. Jobs of other keys are left alone. `restore` of the batch
    undoes it for a while.
    """
    return _filed_batch(name, Visibility.DELETED, farm, who)


@router.post("/batches/{name}/restore", **_BATCH)
def restore_batch(name: BatchName, farm: Farm, who: CallerOf) -> BatchSteered:
    """Put the archived and deleted jobs of a batch back into the list and the batch.

    The answer says what became of each. Jobs of other keys are left alone. Repeating it is
    harmless.
    """
    return _filed_batch(name, Visibility.LISTED, farm, who)


def _filed(job_id: str, visibility: Visibility, farm: Parts, who: Caller) -> JobView:
    farm.visibility.set(farm.job(job_id).id, visibility)
    return shown([farm.job(job_id)], farm, who)[0]


def _filed_batch(name: str, visibility: Visibility, farm: Parts, who: Caller) -> BatchSteered:
    steered = farm.visibility.set_batch(name, visibility, may_touch=who.may_steer)
    return steered_view(name, steered)
