"""Routes that list, sum up and steer batches."""

from typing import Annotated, Any, Final

from fastapi import APIRouter, Depends, Query

from plateau.farm.ledger.batches import Steer
from plateau.farm.wire.batch_views import (
    BatchPage,
    BatchSteered,
    BatchView,
    batch_view,
    line_view,
    steered_view,
)
from plateau.service.api.access.callers import Caller, CallerOf
from plateau.service.api.http.parameters import BatchName, Cursor, cursor_of, number_of
from plateau.service.api.parts import Parts, parts
from plateau.service.api.problems import problem as problems
from plateau.service.api.problems.problem import documented

router = APIRouter(prefix="/v1/batches", tags=["batches"])

_Farm = Annotated[Parts, Depends(parts)]
_RESPONSES: Final[dict[int | str, dict[str, Any]]] = documented(problems.UNKNOWN_BATCH)


@router.get("", responses=documented(problems.INVALID_REQUEST))
def list_batches(
    farm: _Farm,
    cursor: Cursor = None,
    limit: Annotated[
        int, Query(ge=1, le=100, description="most batches on the page", examples=[20])
    ] = 20,
) -> BatchPage:
    """List batches, those with the newest jobs first."""
    before = number_of(cursor)
    lines, after = farm.batches.page(before=before, limit=limit)
    return BatchPage(
        batches=[line_view(line) for line in lines],
        next_cursor=cursor_of(after),
    )


@router.get("/{name}", responses=_RESPONSES)
def get_batch(name: BatchName, farm: _Farm) -> BatchView:
    """Sum a batch up: how far its jobs are, when they will end, and whether they are even.

    `guard` is what an animator needs to know: frames that stop at different noise flicker. It
    says whether all jobs stop by the same rule, target, `min_spp`, `step` and `view`, which do not,
    which ended without having met their target, and how far apart those are that did.
    """
    return batch_view(farm.batches.get(name))


@router.post("/{name}/cancel", status_code=202, responses=_RESPONSES)
def cancel_batch(name: BatchName, who: CallerOf, farm: _Farm) -> BatchSteered:
    """Cancel all jobs of a batch that have not ended; what is merged of each is kept as its image.

    Says what became of each. Jobs of other keys are left alone. Repeating it is harmless.
    """
    return _steered(name, Steer.CANCEL, who, farm)


@router.post("/{name}/pause", status_code=202, responses=_RESPONSES)
def pause_batch(name: BatchName, who: CallerOf, farm: _Farm) -> BatchSteered:
    """Pause a batch: workers take no more slices of any of its jobs.

    Those that wait for their first slice stay `queued` and are held back (`held`). Says what became
    of each. Jobs of other keys are left alone, and so are jobs that join later. Repeating it is
    harmless.
    """
    return _steered(name, Steer.PAUSE, who, farm)


@router.post("/{name}/resume", status_code=202, responses=_RESPONSES)
def resume_batch(name: BatchName, who: CallerOf, farm: _Farm) -> BatchSteered:
    """Let all jobs of a paused batch go on, and those begin that were held back.

    Says what became of each. Jobs of other keys are left alone. Repeating it is harmless.
    """
    return _steered(name, Steer.RESUME, who, farm)


@router.post(
    "/{name}/guard",
    status_code=202,
    responses=documented(problems.UNKNOWN_BATCH, problems.UNEVEN_BATCH, problems.NOT_YOUR_JOB),
)
def guard_batch(name: BatchName, who: CallerOf, farm: _Farm) -> BatchView:
    """Guard a batch against flicker: from now on it takes only jobs that stop as those it has.

    Those have to stop alike already: 409 names one that does not, and in what. All of them have to
    be the key's own, or it takes an admin's. Repeating it is harmless; it lasts as long as the
    batch.
    """
    return batch_view(farm.batches.guard(name, who.check_may_steer))


def _steered(name: str, steer: Steer, who: Caller, farm: Parts) -> BatchSteered:
    steered = farm.batches.steer(name, steer, by=who.name, may_touch=who.may_steer)
    return steered_view(name, steered)
