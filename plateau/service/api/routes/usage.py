"""Routes that sum up what the jobs have cost."""

from datetime import datetime, timezone
from typing import Annotated, Final

from fastapi import APIRouter, Query

from plateau.farm.ledger.usage import usage
from plateau.farm.model.usage import Grouping
from plateau.farm.wire.usage_views import Usage
from plateau.service.api.parts import Farm
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import documented
from plateau.service.api.problems.problem import Problem

router = APIRouter(prefix="/v1", tags=["farm"])

_TIME: Final = (
    r"^[0-9]{4}-[0-9]{2}-[0-9]{2}"
    r"(T[0-9]{2}:[0-9]{2}(:[0-9]{2})?(Z|[+-][0-9]{2}:[0-9]{2})?)?$"
)
_MOST_ROWS: Final = 100_000


@router.get("/usage", responses=documented(problems.INVALID_REQUEST))
def get_usage(
    farm: Farm,
    by: Annotated[Grouping, Query(description="what a row is", examples=["batch"])] = "week",
    since: Annotated[
        str | None,
        Query(
            pattern=_TIME,
            description="jobs submitted from this day, or time, on; UTC unless it says otherwise",
            examples=["2026-11-01"],
        ),
    ] = None,
    until: Annotated[
        str | None,
        Query(
            pattern=_TIME,
            description="and before this day or time",
            examples=["2026-12-01T00:00:00Z"],
        ),
    ] = None,
    limit: Annotated[
        int,
        Query(
            ge=1,
            le=_MOST_ROWS,
            description="most rows: those of the most core hours",
            examples=[20],
        ),
    ] = _MOST_ROWS,
) -> Usage:
    """Sum up what the stored jobs have cost.

    A job counts as a whole where it was submitted, and not any more once it was removed.
    """
    first, end = _time("since", since), _time("until", until)
    if first is not None and end is not None and end <= first:
        raise Problem(problems.UNTIL_BEFORE_SINCE, until=end, since=first)
    rows, left_out, total = usage(farm.redis, by, since=first, until=end, limit=limit)
    return Usage(
        by=by,
        since=first,
        until=end,
        rows=rows,
        left_out=left_out,
        total=total,
    )


def _time(name: str, text: str | None) -> datetime | None:
    if text is None:
        return None
    try:
        time = datetime.fromisoformat(text.replace("Z", "+00:00"))  # for Python 3.10
    except ValueError as error:
        raise Problem(problems.NO_TIME, name=name, text=text, error=error) from None
    return time if time.tzinfo else time.replace(tzinfo=timezone.utc)
