"""Routes for the images of a job: the merged image, maps of it, its previews, and kept slices."""

from typing import Annotated, Final

from fastapi import APIRouter, Path, Response

from plateau.farm.blobs import names as blobs
from plateau.farm.model.job import Job
from plateau.farm.wire.views import Preview, PreviewList
from plateau.picture import previews
from plateau.service.api.http.etags import FINAL, IfNoneMatch, Known, strong
from plateau.service.api.http.served_blobs import (
    EXR,
    PNG,
    SPP,
    blob_response,
    headers_of,
    serving,
)
from plateau.service.api.parts import Farm, Parts
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import documented
from plateau.service.api.problems.problem import Problem, ProblemType
from plateau.service.api.routes.jobs import JobId
from plateau.service.api.stored_files import SpoiledBlob

router = APIRouter(prefix="/v1/jobs/{job_id}", tags=["results"])


#: What each picture shows, for the API's description.
_PICTURES: Final = {
    "image": "the newest merged image as the job's display shows it; after the end, the final one",
    "difference": "what has changed visibly since the first image",
    "noise": "where noise is left to see, in orange: the pixels that `estimate_pixels` counts. Of "
    "two images with noise like this one's, a pixel differs visibly in both, or in one where it is "
    "of a darker orange. In another image of as many samples other pixels differ, about as many",
    "quality": "where a person would see the noise, by ColorVideoVDP, if a rule of the job goes by "
    "it: from dark blue, nowhere, to yellow, as much as 3 JOD and more",
    "spp": "how many samples each pixel has, if the job is by zones: from dark blue to yellow, on "
    "a logarithmic scale. The text chunks `plateau:spp_min` and `plateau:spp_max` have its ends",
    "non-finite": "where the merged image is NaN (magenta) or infinite (blue), if it has such "
    "pixels, which are left out of every count. More than 0.1 % of them fail the job",
    "thumbnail": "the merged image, its longer side of 192 pixels at most",
}


@router.get("/{picture}.png", **serving(PNG, problems.NO_IMAGE_YET, problems.UNKNOWN_PATH))
def get_picture_png(
    job_id: JobId,
    picture: Annotated[
        str,
        Path(
            description="; ".join(f"`{name}`: {what}" for name, what in _PICTURES.items()),
            json_schema_extra={"enum": list(_PICTURES)},
            examples=["image"],
        ),
    ],
    farm: Farm,
    has: IfNoneMatch,
) -> Response:
    """Show a picture of the merged image, or a map of it."""
    if picture not in _PICTURES:
        path = f"/v1/jobs/{job_id}/{picture}.png"
        raise Problem(problems.UNKNOWN_PATH, path=path)
    return _image(f"{picture}.png", PNG, job_id, farm, has)


@router.get("/image.exr", **serving(EXR, problems.NO_IMAGE_YET))
def get_image_exr(job_id: JobId, farm: Farm, has: IfNoneMatch) -> Response:
    """Show the merged image as linear radiance, float32."""
    return _image("image.exr", EXR, job_id, farm, has)


@router.get("/slices/{index}.exr", **serving(EXR, problems.UNKNOWN_SLICE, problems.INVALID_REQUEST))
def get_slice_exr(
    job_id: JobId,
    index: Annotated[int, Path(ge=0, description="the slice's index", examples=[0])],
    farm: Farm,
    has: IfNoneMatch,
) -> Response:
    """Fetch a slice of a job that keeps its slices: R, G, B and W before normalisation."""
    job = farm.job(job_id)
    try:
        record = farm.jobs.ledger(job.id)[index]
        blob, sha256 = record["blob"], record["sha256"]
        if not blobs.is_partial(blob):  # workers are not trusted
            raise FileNotFoundError(blob)
        headers = headers_of(job, strong(sha256), f"{job.id}-{index:06d}.exr")
        return blob_response(blob, sha256, EXR, headers, farm, has)
    except (KeyError, FileNotFoundError) as error:
        raise Problem(problems.UNKNOWN_SLICE, job=job.id, index=index) from error


@router.get("/previews", responses=documented(problems.UNKNOWN_JOB))
def list_previews(job_id: JobId, farm: Farm) -> PreviewList:
    """List the points of the job's curve of which a picture is kept.

    A job keeps up to 256 pictures in 64 MB, or 24 larger ones, and at most one for every 2 s. The
    first point's is among them; of too many, those remain that are spread best in ratios of spp.
    """
    job = farm.job(job_id)
    return PreviewList(
        previews=[
            Preview(spp=spp, link=f"/v1/jobs/{job.id}/previews/{spp}.png")
            for spp in previews.kept(farm.blobs, job.id)
        ]
    )


@router.get("/previews/{spp}.png", **serving(PNG, problems.UNKNOWN_POINT, problems.INVALID_REQUEST))
def get_preview_png(
    job_id: JobId,
    spp: Annotated[
        int, Path(ge=1, le=1_000_000, description="as `previews` lists it", examples=[100])
    ],
    farm: Farm,
    has: IfNoneMatch,
) -> Response:
    """Show the merged image at a point of the curve."""
    job = farm.job(job_id)
    blob = blobs.preview(job.id, spp)
    headers = {
        **headers_of(job, strong(job.id, spp, "preview.png"), f"{job.id}-{spp}-spp.png"),
        "Cache-Control": FINAL,  # the image at a given spp never changes
        SPP: str(spp),
    }
    try:
        return blob_response(blob, farm.jobs.sha256(blob), PNG, headers, farm, has)
    except FileNotFoundError as error:
        raise Problem(problems.UNKNOWN_POINT, job=job.id, spp=spp) from error


def _image(name: str, media_type: str, job_id: str, farm: Parts, has: Known) -> Response:
    job = farm.job(job_id)
    results, sha256 = "", None
    # A set of pictures is deleted when the next one is shown, which may happen meanwhile.
    while (shown := farm.jobs.results(job.id)) != results:
        results = shown
        # A set that was shown never changes, so its name identifies its bytes.
        tag = strong(results.rpartition("/")[2], name)
        blob = f"{results}/{name}"
        sha256 = farm.jobs.sha256(blob)
        try:
            headers = headers_of(job, tag, f"{job.id}-{name}")
            if spp := blobs.spp_of_set(results):
                headers[SPP] = str(spp)
            return blob_response(blob, sha256, media_type, headers, farm, has)
        except FileNotFoundError:
            continue
    if sha256 is not None:
        raise SpoiledBlob(blob)
    raise Problem(
        _why_no_image(job, name),
        job=job.id,
        clause=job.state.clause,
        state=job.state.value,
        reason=job.reason,
        image_spp=job.image_spp,
        first_spp=min(job.spec.step, job.spec.max_spp),
    )


def _why_no_image(job: Job, name: str) -> ProblemType:
    if name != "image.exr" and not job.spec.pictures:
        return problems.NO_PICTURES
    lost = job.state.ended and job.points  # the difference map comes with the first point
    if name == "difference.png" and job.image_spp and not lost:
        return problems.NO_DIFFERENCE if job.state.ended else problems.NO_DIFFERENCE_YET
    if name == "quality.png" and not job.spec.by_quality:
        return problems.NO_QUALITY
    if name in {"noise.png", "quality.png"} and job.image_spp:
        return problems.NOISE_UNKNOWN
    if name == "spp.png" and not job.spec.by_zones:
        return problems.NO_ZONES
    if name == "non-finite.png" and job.image_spp:
        return problems.ALL_FINITE
    return problems.NO_IMAGE_LEFT if job.state.ended else problems.NO_IMAGE_YET
