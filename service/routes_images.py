"""Routes for the images of a job: the merged one, what is visible in it, and kept slices."""

from collections.abc import Iterator
from typing import Annotated, Any, Final

from fastapi import APIRouter, Depends, Path, Request, Response
from fastapi.responses import StreamingResponse

from farm import blobs
from farm.job import Job
from service import previews, problems
from service.etags import FINAL, NOT_MODIFIED, Known, cache_control, known, not_modified, strong
from service.head import HEADERS_ONLY
from service.parts import Parts, parts
from service.problems import Problem, documented
from service.routes_jobs import JobId
from service.views import Preview, PreviewList

router = APIRouter(prefix="/v1/jobs/{job_id}", tags=["results"])

_PNG: Final = "image/png"
_EXR: Final = "image/x-exr"
#: The header that says how many samples per pixel an image has: a running job's grow on.
_SPP: Final = "Plateau-Spp"

_Farm = Annotated[Parts, Depends(parts)]
_Known = Annotated[Known, Depends(known)]


def _served(media_type: str, *kinds: problems.ProblemType) -> dict[int | str, dict[str, Any]]:
    """The ``responses`` of a route that serves a blob."""
    names = ("ETag", "Cache-Control", "Content-Disposition", _SPP)
    binary = {"schema": {"type": "string", "format": "binary"}}
    return {
        200: {
            "description": "the file's bytes",
            "content": {media_type: binary},
            "headers": {name: {"schema": {"type": "string"}} for name in names},
        },
        **NOT_MODIFIED,
        **documented(problems.UNKNOWN_JOB, *kinds),
    }


@router.get(
    "/image.png", response_class=StreamingResponse, responses=_served(_PNG, problems.NO_IMAGE_YET)
)
def image_png(request: Request, job_id: JobId, farm: _Farm, has: _Known) -> Response:
    """Show the merged image as the job's display shows it: the newest, in the end the final one."""
    return _image("image.png", _PNG, job_id, farm, has, request)


@router.get(
    "/image.exr", response_class=StreamingResponse, responses=_served(_EXR, problems.NO_IMAGE_YET)
)
def image_exr(request: Request, job_id: JobId, farm: _Farm, has: _Known) -> Response:
    """Show the merged image as linear radiance, float32."""
    return _image("image.exr", _EXR, job_id, farm, has, request)


@router.get(
    "/difference.png",
    response_class=StreamingResponse,
    responses=_served(_PNG, problems.NO_IMAGE_YET),
)
def difference_png(request: Request, job_id: JobId, farm: _Farm, has: _Known) -> Response:
    """Show where the merged image differs visibly from the first image of the curve."""
    return _image("difference.png", _PNG, job_id, farm, has, request)


@router.get(
    "/thumbnail.png",
    response_class=StreamingResponse,
    responses=_served(_PNG, problems.NO_IMAGE_YET),
)
def thumbnail_png(request: Request, job_id: JobId, farm: _Farm, has: _Known) -> Response:
    """Show the merged image in small, for lists: its longer side has 192 pixels at most."""
    return _image("thumbnail.png", _PNG, job_id, farm, has, request)


@router.get("/previews", responses=documented(problems.UNKNOWN_JOB))
def list_previews(job_id: JobId, farm: _Farm) -> PreviewList:
    """List the pictures that the job keeps of its way: of 24 points of its curve at most.

    Each is what `image.png` was then. There is at most one for every 2 s, and the first point's is
    among them; where there are too many, those stay that are spread best in ratios of spp.
    """
    job = farm.job(job_id)
    root = f"/v1/jobs/{job.id}/previews"
    spps = previews.kept(farm.blobs, job.id)
    return PreviewList(previews=[Preview(spp=spp, link=f"{root}/{spp}.png") for spp in spps])


@router.get(
    "/previews/{spp}.png",
    response_class=StreamingResponse,
    responses=_served(_PNG, problems.NO_IMAGE_YET, problems.INVALID_REQUEST),
)
def preview_png(
    request: Request,
    job_id: JobId,
    spp: Annotated[
        int, Path(ge=1, le=1_000_000, description="as `previews` lists it", examples=[100])
    ],
    farm: _Farm,
    has: _Known,
) -> Response:
    """Show what the merged image looked like at a point of the curve."""
    job = farm.job(job_id)
    # What the image was at some spp never changes.
    headers = _headers(job, strong(job.id, spp, "preview.png"), f"{job.id}-{spp}-spp.png")
    headers |= {"Cache-Control": FINAL, _SPP: str(spp)}
    try:
        return _blob(blobs.preview(job.id, spp), _PNG, headers, farm, has, request)
    except FileNotFoundError as error:
        raise Problem(
            problems.NO_IMAGE_YET,
            f"job {job.id} keeps no picture of {spp} spp; GET /v1/jobs/{job.id}/previews lists "
            "those that it keeps",
            state=job.state.value,
        ) from error


@router.get(
    "/slices/{index}.exr",
    response_class=StreamingResponse,
    responses=_served(_EXR, problems.UNKNOWN_SLICE, problems.INVALID_REQUEST),
)
def slice_exr(
    request: Request,
    job_id: JobId,
    index: Annotated[int, Path(ge=0, description="the slice's index", examples=[0])],
    farm: _Farm,
    has: _Known,
) -> Response:
    """Fetch a slice of a job that keeps its slices: R, G, B and W before normalisation."""
    job = farm.job(job_id)
    try:
        record = farm.jobs.ledger(job.id)[index]
        headers = _headers(job, strong(record["sha256"]), f"{job.id}-{index:06d}.exr")
        return _blob(record["blob"], _EXR, headers, farm, has, request)
    except (KeyError, FileNotFoundError) as error:
        raise Problem(
            problems.UNKNOWN_SLICE,
            f"slice {index} of job {job.id} is not stored; slices stay where the job's spec says "
            "keep_slices",
        ) from error


def _image(
    name: str, media_type: str, job_id: str, farm: Parts, has: Known, request: Request
) -> Response:
    job = farm.job(job_id)
    results = ""
    # A set of pictures goes when the next one is shown, perhaps between our two looks.
    while (shown := farm.jobs.results(job.id)) != results:
        results = shown
        # A set that was shown never changes: its name stands for its bytes.
        tag = strong(results.rpartition("/")[2], name)
        try:
            headers = _headers(job, tag, f"{job.id}-{name}")
            if results:
                headers[_SPP] = str(blobs.spp_of_set(results))
            return _blob(f"{results}/{name}", media_type, headers, farm, has, request)
        except FileNotFoundError:
            continue
    raise _no_image(job)


def _headers(job: Job, tag: str, file_name: str) -> dict[str, str]:
    return {
        "ETag": tag,
        "Cache-Control": cache_control(job),
        "Content-Disposition": f'inline; filename="{file_name}"',
        # A file has some MB and its reader is on this machine: parts of it help nobody.
        "Accept-Ranges": "none",
    }


def _blob(
    blob: str,
    media_type: str,
    headers: dict[str, str],
    farm: Parts,
    has: Known,
    request: Request,
) -> Response:
    """The blob, or 304; `FileNotFoundError` where there is none."""
    if has.has(headers["ETag"]):
        return not_modified(headers)
    size = farm.blobs.size(blob)
    if size is None:
        raise FileNotFoundError(blob)
    if has.anything:
        return not_modified(headers)
    headers = {**headers, "Content-Length": str(size)}
    if HEADERS_ONLY in request.scope:
        return Response(media_type=media_type, headers=headers)
    chunks = farm.blobs.chunks(blob)
    first = next(chunks, b"")
    return StreamingResponse(_joined(first, chunks), media_type=media_type, headers=headers)


def _joined(first: bytes, rest: Iterator[bytes]) -> Iterator[bytes]:
    yield first
    yield from rest


def _no_image(job: Job) -> Problem:
    if job.state.ended:
        detail = f"job {job.id} is {job.state.value} and left no image: {job.reason}"
    else:
        detail = (
            f"job {job.id} is {job.state.value}; its first image comes a moment after the first "
            f"point of its curve, which GET /v1/jobs/{job.id}/events announces"
        )
    return Problem(problems.NO_IMAGE_YET, detail, state=job.state.value)
