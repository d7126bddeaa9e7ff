"""The route of a job's report."""

import base64
import hashlib
from typing import Final

from fastapi import APIRouter, Response

from plateau.farm.wire.report import STYLE, report_html
from plateau.service.api.http.etags import (
    NOT_MODIFIED,
    REVALIDATE,
    IfNoneMatch,
    not_modified,
    strong,
)
from plateau.service.api.parts import Farm
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import documented
from plateau.service.api.results.job_files import pictures_of
from plateau.service.api.routes.jobs import JobId

router = APIRouter(prefix="/v1/jobs/{job_id}", tags=["results"])

_HTML: Final = "text/html"
_STYLE_HASH: Final = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()
_POLICY: Final = (
    f"default-src 'none'; img-src data:; style-src 'sha256-{_STYLE_HASH}'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'; sandbox"
)
_HEADERS: Final = {"Content-Security-Policy": _POLICY, "Cache-Control": REVALIDATE}


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
    if has.has(tag):
        return not_modified(headers)
    pictures = pictures_of(farm, results) if results else {}
    content = report_html(job, farm.jobs.curve(job.id), happened, pictures)
    return _HtmlResponse(content, headers=headers)
