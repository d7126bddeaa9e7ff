"""The API's documentation page, where calls can be tried: Swagger UI, served from this machine."""

from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Final

from fastapi import APIRouter, Response

from plateau.service.api.http.etags import IfNoneMatch
from plateau.service.api.http.static_files import OWN_ONLY, StaticFile, read_folder, serve

router = APIRouter(include_in_schema=False)

#: Swagger UI uses inline styles, and icons inside its style sheet.
_POLICY: Final = {**OWN_ONLY, "style-src": "'self' 'unsafe-inline'", "img-src": "'self' data:"}


@router.get("/docs")
def docs(has: IfNoneMatch) -> Response:
    """Show the API's documentation, where calls can be tried."""
    return serve(_files(), "docs.html", has, _POLICY)


@router.get("/docs/{name}")
def file(name: str, has: IfNoneMatch) -> Response:
    """Serve a file of the documentation page."""
    return serve(_files(), name, has, _POLICY)


@cache
def _files() -> dict[str, StaticFile]:
    """Our files, and the needed ones of Swagger UI, by name."""
    swagger_ui = read_folder(Path(str(files("fastapi_offline") / "static")))
    needed = ("swagger-ui.css", "swagger-ui-bundle.js")
    return {
        **{name: swagger_ui[name] for name in needed},
        **read_folder(Path(__file__).parents[1] / "docs_page"),
    }
