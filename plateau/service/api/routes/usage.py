"""Routes that sum up what the jobs have cost."""

from datetime import datetime, timezone
from typing import Annotated, Final

from fastapi import APIRouter, Depends, Header, Query, Response

from plateau.farm.ledger.usage import usage
from plateau.farm.model.usage import Grouping
from plateau.farm.wire.usage_views import Usage, row_view, usage_csv
from plateau.service.api.http.parameters import chosen
from plateau.service.api.parts import Farm, Parts
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import documented
from plateau.service.api.problems.problem import Problem

router = APIRouter(prefix="/v1", tags=["farm"])

_CSV: Final = "text/csv"
_JSON: Final = "application/json"
_TIME: Final = (
    r"^[0-9]{4}-[0-9]{2}-[0-9]{2}"
    r"(T[0-9]{2}:[0-9]{2}(:[0-9]{2})?(Z|[+-][0-9]{2}:[0-9]{2})?)?$"
)
_CSV_EXAMPLE: Final = (
    "key,name,jobs,machine_s,wasted_s,core_hours,saved_core_hours\n"
    "exposures,,12,124.8,0.6,0.277333,1.2\n"
)
_MOST_ROWS: Final = 100_000


def _usage(
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
    return _summed(farm, by, _time("since", since), _time("until", until), limit)


def _summed(
    farm: Parts, by: Grouping, since: datetime | None, until: datetime | None, limit: int
) -> Usage:
    if since is not None and until is not None and until <= since:
        raise Problem(problems.UNTIL_BEFORE_SINCE, until=until, since=since)
    rows, left_out, total = usage(farm.redis, by, since=since, until=until, limit=limit)
    return Usage(
        by=by,
        since=since,
        until=until,
        rows=list(map(row_view, rows)),
        left_out=left_out,
        total=row_view(total),
    )


def _time(name: str, text: str | None) -> datetime | None:
    if text is None:
        return None
    try:
        time = datetime.fromisoformat(text.replace("Z", "+00:00"))  # for Python 3.10
    except ValueError as error:
        raise Problem(problems.NO_TIME, name=name, text=text, error=error) from None
    return time if time.tzinfo else time.replace(tzinfo=timezone.utc)


_Usage = Annotated[Usage, Depends(_usage)]


class _CsvResponse(Response):
    media_type = _CSV


@router.get(
    "/usage",
    response_model=Usage,
    responses={
        200: {
            "content": {_CSV: {"schema": {"type": "string"}, "example": _CSV_EXAMPLE}},
            "headers": {"Vary": {"schema": {"type": "string"}}},
        },
        **documented(problems.INVALID_REQUEST, problems.NOT_ACCEPTABLE),
    },
)
def get_usage(
    usage: _Usage, accept: Annotated[str, Header(include_in_schema=False)] = ""
) -> Response:
    """Sum up what the stored jobs have cost, as JSON, or as CSV by `Accept`.

    A job counts as a whole where it was submitted, and not any more once it was removed.
    """
    vary = {"Vary": "Accept"}
    if chosen(accept, (_JSON, _CSV)) == _CSV:
        return _CsvResponse(usage_csv(usage), headers=vary)
    return Response(usage.model_dump_json(), media_type=_JSON, headers=vary)
