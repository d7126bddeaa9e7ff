"""The route of a job's report."""

from typing import Final

from fastapi import APIRouter, Response

from plateau.service.api.http.etags import (
    NOT_MODIFIED,
    REVALIDATE,
    IfNoneMatch,
    not_modified,
    strong,
)
from plateau.service.api.parts import Farm
from plateau.service.api.points.stored_files import SpoiledBlob
from plateau.service.api.problems import problem as problems
from plateau.service.api.problems.problem import documented
from plateau.service.api.report.report import CAPTIONS, POLICY, report_html
from plateau.service.api.routes.jobs import JobId

router = APIRouter(prefix="/v1/jobs/{job_id}", tags=["results"])

_HTML: Final = "text/html"
_HEADERS: Final = {"Content-Security-Policy": POLICY, "Cache-Control": REVALIDATE}


class _HtmlResponse(Response):
    media_type = _HTML


@router.get(
    "/report.html",
    response_class=_HtmlResponse,
    responses={
        200: {
            "description": "the report",
            "content": {
                _HTML: {
                    "schema": {"type": "string"},
                    "example": "<!doctype html><title>box.zip: converged at 475 spp</title>…",
                }
            },
            "headers": {
                name: {"schema": {"type": "string"}}
                for name in ("ETag", "Cache-Control", "Content-Disposition")
            },
        },
        **NOT_MODIFIED,
        **documented(problems.UNKNOWN_JOB),
    },
)
def get_report(job_id: JobId, farm: Farm, has: IfNoneMatch) -> Response:
    """Show a job on one self-contained page: pictures, curve, figures, points and story.

    The page has no script and loads nothing, so it can be kept beside the image.
    """
    job = farm.job(job_id)
    results = farm.jobs.results(job.id)
    happened = farm.jobs.events(job.id)
    # A report changes only with an event or a new set of pictures.
    tag = strong(results.rpartition("/")[2], len(happened), job.points, "report.html")
    headers = {
        **_HEADERS,
        "ETag": tag,
        "Content-Disposition": f'inline; filename="{job.id}-report.html"',
    }
    if has.anything or has.has(tag):
        return not_modified(headers)
    pictures: dict[str, bytes | None] = {}
    for name in CAPTIONS if results else ():
        blob = f"{results}/{name}"
        try:
            pictures[name] = farm.files.content(blob, farm.jobs.sha256(blob))
        except SpoiledBlob:
            pictures[name] = None
        except FileNotFoundError:  # a newer set has just been shown, or this one has no map yet
            continue
    content = report_html(job, farm.jobs.curve(job.id), happened, pictures)
    return _HtmlResponse(content, headers=headers)
