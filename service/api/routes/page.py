"""The web page: its files as they lie in ``service/page``, nothing built, nothing from elsewhere.

The page is a client of the API like any other. What it may do is written in its headers: run its
own scripts, talk to this API, show pictures from it, and nothing else.
"""

from functools import cache
from pathlib import Path
from typing import Annotated, Final

from fastapi import APIRouter, Depends, Response

from plateau.service.api.http.etags import Known, known
from plateau.service.api.http.static_files import OWN_ONLY, StaticFile, read_folder, serve

router = APIRouter(include_in_schema=False)

#: Trusted types without a policy: no text can become markup, whatever a script of ours does.
_POLICY: Final = {
    **OWN_ONLY,
    "style-src": "'self'",
    "img-src": "'self' blob:",
    "require-trusted-types-for": "'script'",
    "trusted-types": "'none'",
}
_Known = Annotated[Known, Depends(known)]


@router.get("/")
@router.get("/submit")
@router.get("/workers")
@router.get("/jobs/{job_id}")
@router.get("/studies")
@router.get("/studies/{study_id}")
@router.get("/studies/{study_id}/observe")
def page(has: _Known) -> Response:
    """Show the page; which of its screens is shown, it reads from the path."""
    return serve(_files(), "index.html", has, _POLICY)


@router.get("/page/{name:path}")
def file(name: str, has: _Known) -> Response:
    """Serve a file of the page."""
    return serve(_files(), name, has, _POLICY)


@cache
def _files() -> dict[str, StaticFile]:
    """The page's files by their paths: some 300 KB, read once."""
    return read_folder(Path(__file__).parents[2] / "page")
