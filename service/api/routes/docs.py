"""The API's own page, where calls can be tried: Swagger UI, from this machine like all else."""

from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Final

from fastapi import APIRouter, Depends, Response

from plateau.service.api.http.etags import Known, known
from plateau.service.api.http.static_files import OWN_ONLY, StaticFile, read_folder, serve

router = APIRouter(include_in_schema=False)

#: Swagger UI styles its elements one by one, and has its icons in its style sheet.
_POLICY: Final = {
    **OWN_ONLY,
    "style-src": "'self' 'unsafe-inline'",
    "img-src": "'self' data:",
}

_Known = Annotated[Known, Depends(known)]


@router.get("/docs")
def docs(has: _Known) -> Response:
    """Show what the API takes and answers, and let calls be tried."""
    return serve(_files(), "docs.html", has, _POLICY)


@router.get("/docs/{name}")
def file(name: str, has: _Known) -> Response:
    """Serve a file of that page."""
    return serve(_files(), name, has, _POLICY)


@cache
def _files() -> dict[str, StaticFile]:
    """Ours, and those of Swagger UI that it needs, by their names."""
    swagger_ui = read_folder(Path(str(files("fastapi_offline") / "static")))
    needed = ("swagger-ui.css", "swagger-ui-bundle.js")
    return {
        **{name: swagger_ui[name] for name in needed},
        **read_folder(Path(__file__).parents[1] / "docs_page"),
    }
