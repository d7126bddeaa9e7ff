"""Routes for what a job has come to: its curve, its events and its images."""

import contextlib
import csv
import io
import json
from collections.abc import AsyncIterator, Iterator
from itertools import chain
from typing import Annotated, Final

from fastapi import APIRouter, Depends, Header, Path, Query, Request, Response
from fastapi.responses import PlainTextResponse, StreamingResponse
from starlette.concurrency import run_in_threadpool

from farm.job import CurvePoint, Event
from farm.jobs import BEFORE_ALL_EVENTS
from service import problems
from service.parts import Parts, parts
from service.problems import Problem, documented
from service.routes_jobs import JobId
from service.views import Curve, Happened

router = APIRouter(prefix="/v1/jobs/{job_id}", tags=["results"])

_CSV: Final = "text/csv"
_JSON: Final = "application/json"
_SSE: Final = "text/event-stream"
_FIGURES: Final = tuple(
    name
    for name in CurvePoint.model_fields
    if name not in {"rules", "zones", "non_finite_pixels", "at"}
)
_EVENT_ID: Final = r"^\d{1,20}-\d{1,20}$"
#: Proxies close a connection that is silent for longer, commonly after 30 or 60 s.
_HEARTBEAT_S: Final = 15.0
_RECONNECT_MS: Final = 1000

#: The images of a job, as they are stored and served.
IMAGES: Final = {
    "image.png": "image/png",
    "image.exr": "image/x-exr",
    "difference.png": "image/png",
}


def curve_csv(points: list[CurvePoint]) -> str:
    """The points as CSV: the figures, the time, then each rule's value and verdict."""
    rules = sorted({name for point in points for name in point.rules})
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    header = [*_FIGURES, "non_finite_pixels", "at"]
    writer.writerow([*header, *chain(*((f"{rule}_value", f"{rule}_stop") for rule in rules))])
    for point in points:
        row = [*(getattr(point, name) for name in header[:-1]), point.at.isoformat()]
        for rule in rules:
            said = point.rules.get(rule)
            row += [said.value, str(said.stop).lower()] if said else [None, None]
        writer.writerow(row)
    return text.getvalue()


@router.get(
    "/curve",
    response_model=Curve,
    responses={200: {"content": {_CSV: {}}}, **documented(problems.UNKNOWN_JOB)},
)
def curve(
    job_id: JobId,
    farm: Annotated[Parts, Depends(parts)],
    accept: Annotated[str, Header(include_in_schema=False)] = "*/*",
) -> Curve | Response:
    """Show the curve: each evaluation of the merged image, as JSON, or as CSV by `Accept`."""
    points = farm.jobs.curve(farm.job(job_id).id)
    if _CSV in accept:
        return PlainTextResponse(curve_csv(points), media_type=_CSV)
    return Curve(points=points)


@router.get(
    "/curve.csv",
    response_class=PlainTextResponse,
    responses={200: {"content": {_CSV: {}}}, **documented(problems.UNKNOWN_JOB)},
)
def curve_as_csv(job_id: JobId, farm: Annotated[Parts, Depends(parts)]) -> Response:
    """Show the curve as CSV."""
    points = farm.jobs.curve(farm.job(job_id).id)
    return PlainTextResponse(curve_csv(points), media_type=_CSV)


@router.get(
    "/events",
    response_class=StreamingResponse,
    responses={
        200: {"model": Happened, "content": {_SSE: {}}},
        204: {"description": "the job is finished and everything of it was already received"},
        **documented(problems.UNKNOWN_JOB, problems.INVALID_REQUEST),
    },
)
async def events(
    request: Request,
    job_id: JobId,
    last_event_id: Annotated[
        str | None, Header(pattern=_EVENT_ID, description="go on after this event")
    ] = None,
    after: Annotated[
        str, Query(pattern=_EVENT_ID, description="the same, where a header cannot be set")
    ] = BEFORE_ALL_EVENTS,
    accept: Annotated[str, Header(include_in_schema=False)] = _SSE,
) -> Response:
    """Stream what happens to a job as Server-Sent Events, from its beginning on.

    `state` (from, to, reason), `point` (a point of the curve), `slice` (index, worker), `trouble`
    (index, worker, cause: a worker died on a slice, or a partial was lost) and, once all results
    are written, `finished`, after which the stream ends. An event's `id` resumes the stream. With
    `Accept: application/json`, what has happened so far.
    """
    farm = parts(request)
    start = last_event_id or after
    job = await run_in_threadpool(farm.job, job_id)
    if _JSON in accept and _SSE not in accept:
        happened = Happened(events=await run_in_threadpool(farm.jobs.events, job.id, start))
        return Response(happened.model_dump_json(), media_type=_JSON)
    if job.finished_at is not None and not await run_in_threadpool(farm.jobs.events, job.id, start):
        return Response(status_code=204)
    return StreamingResponse(
        _frames(farm, job.id, start),
        media_type=_SSE,
        headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"},
    )


async def _frames(farm: Parts, job_id: str, after: str) -> AsyncIterator[str]:
    yield f"retry: {_RECONNECT_MS}\n\n"
    async for batch in farm.hub.events(job_id, after, idle_s=_HEARTBEAT_S):
        yield "".join(map(frame, batch)) or ": still here\n\n"


def frame(event: Event) -> str:
    """The event as a frame of a Server-Sent Events stream; its data has its time as ``at``."""
    data = json.dumps({"at": event.at.isoformat(), **event.data})
    return f"id: {event.id}\nevent: {event.type}\ndata: {data}\n\n"


def _image(name: str, job_id: str, farm: Parts) -> Response:
    job = farm.job(job_id)
    results = ""
    # A set of pictures goes when the next one is shown, perhaps between our two looks.
    while (shown := farm.jobs.results(job.id)) != results:
        results = shown
        with contextlib.suppress(FileNotFoundError):
            return _blob(f"{results}/{name}", f"{job.id}-{name}", IMAGES[name], farm)
    raise _no_image(job.state.ended, job.id, job.state.value, job.reason)


def _blob(blob: str, file_name: str, media_type: str, farm: Parts) -> Response:
    chunks = farm.blobs.chunks(blob)
    first = next(chunks, b"")
    return StreamingResponse(
        _joined(first, chunks),
        media_type=media_type,
        headers={
            # It changes while the job runs.
            "Cache-Control": "no-cache",
            "Content-Disposition": f'inline; filename="{file_name}"',
        },
    )


def _joined(first: bytes, rest: Iterator[bytes]) -> Iterator[bytes]:
    yield first
    yield from rest


def _no_image(ended: bool, job_id: str, state: str, reason: str) -> Problem:
    if ended:
        detail = f"job {job_id} is {state} and left no image: {reason}"
    else:
        detail = (
            f"job {job_id} is {state}; its first image comes with the first point of its curve, "
            f"which GET /v1/jobs/{job_id}/events announces"
        )
    return Problem(problems.NO_IMAGE_YET, detail, state=state)


_IMAGE_PROBLEMS: Final = documented(problems.UNKNOWN_JOB, problems.NO_IMAGE_YET)


@router.get(
    "/image.png",
    response_class=StreamingResponse,
    responses={200: {"content": {"image/png": {}}}, **_IMAGE_PROBLEMS},
)
def image_png(job_id: JobId, farm: Annotated[Parts, Depends(parts)]) -> Response:
    """Show the merged image as the job's display shows it: the newest, in the end the final one."""
    return _image("image.png", job_id, farm)


@router.get(
    "/image.exr",
    response_class=StreamingResponse,
    responses={200: {"content": {"image/x-exr": {}}}, **_IMAGE_PROBLEMS},
)
def image_exr(job_id: JobId, farm: Annotated[Parts, Depends(parts)]) -> Response:
    """Show the merged image as linear radiance, float32."""
    return _image("image.exr", job_id, farm)


@router.get(
    "/difference.png",
    response_class=StreamingResponse,
    responses={200: {"content": {"image/png": {}}}, **_IMAGE_PROBLEMS},
)
def difference_png(job_id: JobId, farm: Annotated[Parts, Depends(parts)]) -> Response:
    """Show where the merged image differs visibly from the first image of the curve."""
    return _image("difference.png", job_id, farm)


@router.get(
    "/slices/{index}.exr",
    response_class=StreamingResponse,
    responses={
        200: {"content": {"image/x-exr": {}}},
        **documented(problems.UNKNOWN_JOB, problems.UNKNOWN_SLICE),
    },
)
def slice_exr(
    job_id: JobId,
    index: Annotated[int, Path(ge=0, description="the slice's index")],
    farm: Annotated[Parts, Depends(parts)],
) -> Response:
    """Fetch a slice of a job that keeps its slices: R, G, B and W before normalisation."""
    job = farm.job(job_id)
    try:
        blob = farm.jobs.ledger(job.id)[index]["blob"]
        return _blob(blob, f"{job.id}-{index:06d}.exr", IMAGES["image.exr"], farm)
    except (KeyError, FileNotFoundError) as error:
        raise Problem(
            problems.UNKNOWN_SLICE,
            f"slice {index} of job {job.id} is not stored; slices stay where the job's spec says "
            "keep_slices",
        ) from error
