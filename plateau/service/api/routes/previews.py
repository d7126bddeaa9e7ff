"""Routes for the image at points of a job's curve, from kept pictures or kept slices."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Final

from fastapi import APIRouter, Path, Request, Response
from fastapi.responses import StreamingResponse
from starlette.concurrency import run_in_threadpool

from plateau.farm.blobs import names as blobs
from plateau.farm.model.job import Job
from plateau.farm.model.slices.plan import Plan
from plateau.farm.wire.views import Preview, PreviewList
from plateau.picture import previews
from plateau.service.api.http.etags import FINAL, IfNoneMatch, strong
from plateau.service.api.http.layers import HEADERS_ONLY
from plateau.service.api.http.served_blobs import (
    PNG,
    SPP,
    blob_response,
    described,
    headers_of,
)
from plateau.service.api.parts import Farm, Parts
from plateau.service.api.points import KeptSlice, SliceLost
from plateau.service.api.points.images import MOST_PIXELS, MOST_WAITING, TooManyWait
from plateau.service.api.points.stored_files import SpoiledBlob
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import documented
from plateau.service.api.problems.problem import Problem, ProblemType
from plateau.service.api.routes.jobs import JobId

if TYPE_CHECKING:
    from plateau.farm.images.exr import Pixels
    from plateau.farm.images.view_transform import ViewTransform
    from plateau.service.api.points.images import Encode

router = APIRouter(prefix="/v1/jobs/{job_id}/previews", tags=["results"])

_Spp = Annotated[
    int, Path(ge=1, le=1_000_000, description="as `previews` lists it", examples=[100])
]

_PROBLEMS: Final = (
    problems.UNKNOWN_POINT,
    problems.CANNOT_MERGE,
    problems.BUSY,
    problems.INVALID_REQUEST,
)
#: ``Retry-After`` while too many requests wait, in seconds.


@router.get("", responses=documented(problems.UNKNOWN_JOB))
def list_previews(job_id: JobId, farm: Farm) -> PreviewList:
    """List the points of the job's curve that have a picture.

    A job that keeps its slices has a picture of every point. Another job keeps up to 256 pictures
    in 64 MB, or 24 larger ones, and at most one for every 2 s. The first point's is among them; of
    too many, those remain that are spread best in ratios of spp.
    """
    job = farm.job(job_id)
    root = f"/v1/jobs/{job.id}/previews"
    spps = previews.kept(farm.blobs, job.id)
    if _can_be_merged(job):
        spps = sorted({*spps, *_points(job, farm.jobs.plan(job))})
    return PreviewList(previews=[Preview(spp=spp, link=f"{root}/{spp}.png") for spp in spps])


@router.get("/{spp}.png", response_class=StreamingResponse, responses=described(PNG, *_PROBLEMS))
async def get_preview_png(
    request: Request, job_id: JobId, spp: _Spp, farm: Farm, has: IfNoneMatch
) -> Response:
    """Show the merged image at a point of the curve.

    If the job kept its slices and not this picture, they are merged again, which takes about 15 ms
    for each at 512 × 512; the service makes one picture at a time.
    """
    job = await run_in_threadpool(farm.job, job_id)
    headers = _headers(job, spp)
    try:
        blob = blobs.preview(job.id, spp)
        sha256 = await run_in_threadpool(farm.jobs.sha256, blob)
        return await run_in_threadpool(
            blob_response, blob, sha256, PNG, headers, farm, has, request
        )
    except (FileNotFoundError, SpoiledBlob) as error:
        if isinstance(error, SpoiledBlob) and not _can_be_merged(job):
            raise
        return await _merged(request, job, spp, farm, headers)


async def _merged(
    request: Request, job: Job, spp: int, farm: Parts, headers: dict[str, str]
) -> Response:
    slices = await run_in_threadpool(_slices, farm, job, spp)
    if HEADERS_ONLY in request.scope:
        return Response(media_type=PNG, headers=headers)
    try:
        content = await farm.points.encoded(
            job.id,
            slices,
            _png(job, spp),
            request.is_disconnected,
            job.spec.view.background,
            farm.jobs.plan(job).size,
        )
    except TooManyWait as error:
        raise Problem(problems.BUSY_MERGING, most=MOST_WAITING) from error
    except SliceLost as error:
        raise _cannot(problems.SLICE_LOST, job, spp, error=error) from error
    if content is None:
        return Response(status_code=problems.CLIENT_GONE)
    return Response(content, media_type=PNG, headers=headers)


def _slices(farm: Parts, job: Job, spp: int) -> list[KeptSlice]:
    """The slices of a point's image; raises the problem with them."""
    plan = farm.jobs.plan(job)
    slices = plan.slices_of(spp)
    if plan.spp(slices) != spp or not plan.is_point(slices) or spp > job.spp:
        is_even = not plan.by_zones and not plan.looks
        kind = problems.UNKNOWN_POINT if is_even else problems.UNKNOWN_UNEVEN_POINT
        raise Problem(kind, job=job.id, spp=spp, step=job.spec.step, most=job.spp)
    if not job.spec.keep_slices:
        raise _cannot(problems.CANNOT_MERGE, job, spp)
    if not _can_be_merged(job):
        raise _cannot(problems.TOO_LARGE_TO_MERGE, job, spp, most=MOST_PIXELS)
    ledger = farm.jobs.ledger(job.id)
    try:
        records = [ledger[index] for index in range(slices)]
    except KeyError as error:
        raise _cannot(problems.SLICE_MISSING, job, spp, index=error) from error
    return [KeptSlice(record["blob"], record["sha256"]) for record in records]


def _can_be_merged(job: Job) -> bool:
    values = (job.width or 0) * (job.height or 0) * job.spec.film_values
    return job.spec.keep_slices and 0 < values <= 4 * MOST_PIXELS


def _points(job: Job, plan: Plan) -> list[int]:
    """The spp of the points that are merged so far."""
    slices = filter(plan.is_point, range(plan.slices_of(job.spp) + 1))
    return [plan.spp(one) for one in slices]


def _png(job: Job, spp: int) -> "Encode":
    # Imported at the first use, as in `plateau.service.api.points.images`.
    def encoded(image: "Pixels", transform_of: "Callable[[], ViewTransform | None]") -> bytes:
        from plateau.farm.images.png import encode_png
        from plateau.metric import encode_srgb
        from plateau.picture.facts import identity, png_texts

        exposure_ev = job.spec.view.exposure_ev
        transform = transform_of()
        seen = image if transform is None else transform.seen(image, exposure_ev)
        picture = encode_srgb(seen, exposure_ev)
        return encode_png(picture, texts=png_texts(identity(job, spp)))

    return encoded


def _headers(job: Job, spp: int) -> dict[str, str]:
    # The image at a given spp never changes.
    headers = headers_of(job, strong(job.id, spp, "preview.png"), f"{job.id}-{spp}-spp.png")
    return headers | {"Cache-Control": FINAL, SPP: str(spp)}


def _cannot(kind: ProblemType, job: Job, spp: int, **fields: object) -> Problem:
    return Problem(kind, job=job.id, spp=spp, state=job.state.value, **fields)
