"""Routes for a job's curve and its events."""

import hashlib
import json
import time
from collections.abc import AsyncIterator
from typing import Annotated, Any, Final

from fastapi import APIRouter, Header, Query, Request, Response
from fastapi.responses import StreamingResponse
from starlette.concurrency import run_in_threadpool

from plateau.farm.model.job import BEFORE_ALL_EVENTS, CurvePoint, Event
from plateau.farm.wire import examples
from plateau.farm.wire.csv_text import curve_csv
from plateau.farm.wire.views import Curve, Happened
from plateau.service.api.access.callers import Caller, CallerOf
from plateau.service.api.http.etags import (
    NOT_MODIFIED,
    REVALIDATE,
    IfNoneMatch,
    Known,
    not_modified,
    strong,
)
from plateau.service.api.parts import Farm, Parts, parts_of
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import documented
from plateau.service.api.routes.jobs import JobId

router = APIRouter(prefix="/v1/jobs/{job_id}", tags=["results"])

_CSV: Final = "text/csv"
_JSON: Final = "application/json"
_SSE: Final = "text/event-stream"
#: Redis refuses larger numbers.
_EVENT_ID: Final = r"^[0-9]{1,19}-[0-9]{1,19}$"
#: Proxies close a silent connection, commonly after 30 or 60 s.
_HEARTBEAT_S: Final = 5.0
_RECONNECT_MS: Final = 1000

#: Identifies the curve's schema in its ETag: another version may show more of the same points.
_SHAPE: Final = hashlib.sha256(json.dumps(Curve.model_json_schema()).encode()).hexdigest()[:8]
_STRING: Final[dict[str, Any]] = {"schema": {"type": "string"}}
_CURVE: Final = curve_csv([CurvePoint.model_validate(examples.POINT)])
_CURVE_HEADERS: Final = {"ETag": _STRING, "Cache-Control": _STRING}


class _CsvResponse(Response):
    media_type = _CSV


@router.get(
    "/curve",
    response_model=Curve,
    responses={
        200: {"headers": _CURVE_HEADERS},
        **NOT_MODIFIED,
        **documented(problems.UNKNOWN_JOB),
    },
)
def get_curve(job_id: JobId, farm: Farm, has: IfNoneMatch) -> Response:
    """Show the curve: each evaluation of the merged image."""
    return _curve(farm, job_id, has, _JSON)


@router.get(
    "/curve.csv",
    response_class=_CsvResponse,
    responses={
        200: {
            "description": "the points as CSV",
            "content": {_CSV: {"schema": {"type": "string"}, "example": _CURVE}},
            "headers": _CURVE_HEADERS,
        },
        **NOT_MODIFIED,
        **documented(problems.UNKNOWN_JOB),
    },
)
def get_curve_csv(job_id: JobId, farm: Farm, has: IfNoneMatch) -> Response:
    """Show the curve as CSV."""
    return _curve(farm, job_id, has, _CSV)


def _curve(farm: Parts, job_id: str, has: Known, media_type: str) -> Response:
    # Validated even after the job's end: a newer Plateau may show more of its points.
    headers = {"Cache-Control": REVALIDATE}
    job = farm.job(job_id)
    # Points are only appended, so their number identifies them.
    tag = _curve_tag(job.points, media_type)
    if has.has(tag):
        return not_modified({**headers, "ETag": tag})
    points = farm.jobs.curve(job.id)
    headers["ETag"] = _curve_tag(len(points), media_type)
    if media_type == _CSV:
        return _CsvResponse(curve_csv(points), headers=headers)
    content = Curve(points=points).model_dump_json()
    return Response(content, media_type=_JSON, headers=headers)


def _curve_tag(points: int, media_type: str) -> str:
    return strong(points, media_type.rpartition("/")[2], _SHAPE)


@router.get(
    "/events",
    response_class=StreamingResponse,
    responses={
        200: {
            "description": "the events",
            "model": Happened,
            "content": {_SSE: {"schema": {"type": "string"}, "example": examples.EVENT_STREAM}},
        },
        204: {"description": "the job is finished, and the client has all of its events"},
        **documented(problems.UNKNOWN_JOB, problems.INVALID_REQUEST),
    },
)
async def get_events(
    request: Request,
    job_id: JobId,
    who: CallerOf,
    last_event_id: Annotated[
        str | None,
        Header(
            pattern=_EVENT_ID, description="resume after this event", examples=[examples.EVENT_ID]
        ),
    ] = None,
    after: Annotated[
        str,
        Query(
            pattern=_EVENT_ID,
            description="the same, for clients that cannot set a header",
            examples=[examples.EVENT_ID],
        ),
    ] = BEFORE_ALL_EVENTS,
    accept: Annotated[str, Header(include_in_schema=False)] = "",
) -> Response:
    """Stream a job's events as Server-Sent Events, from its beginning on.

    `state` (from, to, reason); `image` (spp), once, when the first image can be fetched, which may
    be the final one; `point` (a point of the curve); `slice` (index, worker); `trouble` (index,
    worker, cause: a worker died on a slice, or a partial was lost); and `finished`, once all
    results are written, after which the stream ends. An event's `id` resumes the stream. With
    `Accept: application/json`, the answer lists the events so far.
    """
    farm = parts_of(request)
    start = last_event_id or after
    job = await run_in_threadpool(farm.job, job_id)
    if _JSON in accept.lower() and _SSE not in accept.lower():
        happened = Happened(events=await run_in_threadpool(farm.jobs.events, job.id, start))
        return Response(happened.model_dump_json(), media_type=_JSON, headers={"Vary": "Accept"})
    if job.finished_at is not None:  # what comes after `finished`, no stream has
        left = await run_in_threadpool(farm.jobs.events, job.id, start)
        if all(one.type != "finished" for one in left):
            return Response(status_code=204)
    return StreamingResponse(
        _frames(farm, job.id, start, who),
        media_type=_SSE,
        headers={"Cache-Control": "no-store", "Vary": "Accept", "X-Accel-Buffering": "no"},
    )


async def _frames(farm: Parts, job_id: str, after: str, who: Caller) -> AsyncIterator[bytes]:
    yield f"retry: {_RECONNECT_MS}\n\n".encode()
    asked_at = time.monotonic()
    async for batch in farm.hub.events(job_id, after, idle_s=_HEARTBEAT_S):
        if time.monotonic() >= asked_at + _HEARTBEAT_S:
            if not await run_in_threadpool(who.is_welcome):
                return
            asked_at = time.monotonic()
        yield b"".join(map(_frame, batch)) or b": still here\n\n"


def _frame(event: Event) -> bytes:
    data = json.dumps({"at": event.at.isoformat(), **event.data})
    return f"id: {event.id}\nevent: {event.type}\ndata: {data}\n\n".encode()
