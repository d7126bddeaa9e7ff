"""The web page: the files of ``service/page``, without a build step and without outside files.

The page is a client of the API like any other. Its content-security policy lets it run its own
scripts, talk to this API and show pictures from it, and nothing else.
"""

from functools import cache
from pathlib import Path
from typing import Final

from fastapi import APIRouter, Response

from plateau.service.api.http.etags import IfNoneMatch
from plateau.service.api.http.static_files import OWN_ONLY, StaticFile, read_folder, serve

router = APIRouter(include_in_schema=False)

#: Trusted types without a policy: no script of ours can turn text into markup.
_POLICY: Final = {
    **OWN_ONLY,
    "style-src": "'self'",
    "img-src": "'self' blob:",
    "require-trusted-types-for": "'script'",
    "trusted-types": "'none'",
}


@router.get("/")
@router.get("/submit")
@router.get("/workers")
@router.get("/jobs/{job_id}")
@router.get("/studies")
@router.get("/studies/{study_id}")
@router.get("/studies/{study_id}/observe")
def page(has: IfNoneMatch) -> Response:
    """Show the page, which chooses its screen by the path."""
    return serve(_files(), "index.html", has, _POLICY)


@router.get("/page/{name:path}")
def file(name: str, has: IfNoneMatch) -> Response:
    """Serve a file of the page."""
    return serve(_files(), name, has, _POLICY)


@cache
def _files() -> dict[str, StaticFile]:
    """The page's files by their paths: some 300 KB, read once."""
    return read_folder(Path(__file__).parents[2] / "page")
