"""Routes that list, sum up and steer batches."""

from typing import Annotated, Any, Final

from fastapi import APIRouter, Query

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
from plateau.service.api.parts import Farm, Parts
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import documented

router = APIRouter(prefix="/v1/batches", tags=["batches"])

_RESPONSES: Final[dict[int | str, dict[str, Any]]] = documented(problems.UNKNOWN_BATCH)


@router.get("", responses=documented(problems.INVALID_REQUEST))
def list_batches(
    farm: Farm,
    cursor: Cursor = None,
    limit: Annotated[
        int, Query(ge=1, le=100, description="most batches on the page", examples=[20])
    ] = 20,
) -> BatchPage:
    """List batches, those with the newest jobs first."""
    before = number_of(cursor)
    lines, after = farm.batches.page(before=before, limit=limit)
    return BatchPage(batches=[line_view(line) for line in lines], next_cursor=cursor_of(after))


@router.get("/{name}", responses=_RESPONSES)
def get_batch(name: BatchName, farm: Farm) -> BatchView:
    """Summarise a batch: the progress of its jobs, and when they will end."""
    return batch_view(farm.batches.get(name))


@router.post("/{name}/cancel", status_code=202, responses=_RESPONSES)
def cancel_batch(name: BatchName, who: CallerOf, farm: Farm) -> BatchSteered:
    """Cancel all jobs of a batch that have not ended; each keeps its merged image.

    The answer says what became of each. Jobs of other keys are left alone. Repeating it is
    harmless.
    """
    return _steered(name, Steer.CANCEL, who, farm)


@router.post("/{name}/pause", status_code=202, responses=_RESPONSES)
def pause_batch(name: BatchName, who: CallerOf, farm: Farm) -> BatchSteered:
    """Pause a batch: workers take no more slices of any of its jobs.

    Jobs that wait for their first slice stay `queued` and are held back (`held`). The answer says
    what became of each. Jobs of other keys are left alone, and so are jobs that join later.
    Repeating it is harmless.
    """
    return _steered(name, Steer.PAUSE, who, farm)


@router.post("/{name}/resume", status_code=202, responses=_RESPONSES)
def resume_batch(name: BatchName, who: CallerOf, farm: Farm) -> BatchSteered:
    """Resume all paused jobs of a batch, and let the jobs that were held back start.

    The answer says what became of each. Jobs of other keys are left alone. Repeating it is
    harmless.
    """
    return _steered(name, Steer.RESUME, who, farm)


def _steered(name: str, steer: Steer, who: Caller, farm: Parts) -> BatchSteered:
    steered = farm.batches.steer(name, steer, by=who.name, may_touch=who.may_steer)
    return steered_view(name, steered)
