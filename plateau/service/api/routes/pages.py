"""The web page, and the API's documentation page, without a build step and without outside files.

The web page is a client of the API like any other. Its files are served from memory; a page's
content-security policy lets it run its own scripts, talk to this API and show pictures from it, and
nothing else.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Final

from fastapi import APIRouter, Response

from plateau.extensions import extensions
from plateau.service.api.http.etags import REVALIDATE, IfNoneMatch, Known, not_modified, strong
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.problem import Problem

router = APIRouter(include_in_schema=False)

_SERVICE: Final = Path(__file__).parents[2]

_MEDIA_TYPES: Final = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".LICENSE": "text/plain; charset=utf-8",
}

_HEADERS: Final = {
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
    "Cache-Control": REVALIDATE,
}

#: The base of a page's policy: it runs its own scripts and talks to this API only.
OWN_ONLY: Final = {
    "default-src": "'none'",
    "script-src": "'self'",
    "connect-src": "'self'",
    "base-uri": "'none'",
    "form-action": "'none'",
    "frame-ancestors": "'none'",
}
#: Trusted types without a policy: no script of ours can turn text into markup.
_PAGE_POLICY: Final = {
    **OWN_ONLY,
    "style-src": "'self'",
    "img-src": "'self' blob:",
    "require-trusted-types-for": "'script'",
    "trusted-types": "'none'",
}
#: Swagger UI uses inline styles, and icons inside its style sheet.
_DOCS_POLICY: Final = {**OWN_ONLY, "style-src": "'self' 'unsafe-inline'", "img-src": "'self' data:"}


@dataclass(frozen=True)
class StaticFile:
    """A file in memory."""

    content: bytes
    media_type: str
    tag: str  #: its ETag


def read_folder(folder: Path) -> dict[str, StaticFile]:
    """The folder's files by their relative paths; only those of known media types."""
    return {
        path.relative_to(folder).as_posix(): static_file(path.read_bytes(), path.suffix)
        for path in folder.rglob("*")
        if path.suffix in _MEDIA_TYPES
    }


def static_file(content: bytes, suffix: str) -> StaticFile:
    """Return a file of this content, and of the media type that goes with the suffix."""
    tag = strong(hashlib.sha256(content).hexdigest()[:16])
    return StaticFile(content, _MEDIA_TYPES[suffix], tag)


@router.get("/")
@router.get("/submit")
@router.get("/workers")
@router.get("/jobs/{job_id}")
def page(has: IfNoneMatch) -> Response:
    """Show the web page, which chooses its screen by the path."""
    return serve(_page_files(), "index.html", has, _PAGE_POLICY)


def unknown_page() -> Response:
    """Show the web page, which says that it has nothing at this path."""
    answer = serve(_page_files(), "index.html", Known(), _PAGE_POLICY)
    answer.status_code = 404
    return answer


@router.get("/page/{name:path}")
def page_file(name: str, has: IfNoneMatch) -> Response:
    """Serve a file of the web page."""
    return serve(_page_files(), name, has, _PAGE_POLICY)


@router.get("/docs")
def docs(has: IfNoneMatch) -> Response:
    """Show the API's documentation, where calls can be tried: Swagger UI."""
    return serve(_docs_files(), "docs.html", has, _DOCS_POLICY)


@router.get("/docs/{name}")
def docs_file(name: str, has: IfNoneMatch) -> Response:
    """Serve a file of the documentation page."""
    return serve(_docs_files(), name, has, _DOCS_POLICY)


@cache
def _page_files() -> dict[str, StaticFile]:
    """The page's files, and those of extensions in folders of their own."""
    found = read_folder(_SERVICE / "page")
    names = []
    for extension in extensions("page"):
        name = extension.__name__.split(".")[-2]
        theirs = read_folder(Path(extension.__path__[0]))
        found |= {f"{name}/{path}": file for path, file in theirs.items()}
        names.append(name)
    imports = "".join(f'import * as {one} from "/page/{one}/extension.js";\n' for one in names)
    listed = f"{imports}export const extensions = [{', '.join(names)}];\n"
    return found | {"extensions.js": static_file(listed.encode(), ".js")}


@cache
def _docs_files() -> dict[str, StaticFile]:
    """Our files, and the needed ones of Swagger UI, by name."""
    swagger_ui = read_folder(Path(str(files("fastapi_offline") / "static")))
    needed = {name: swagger_ui[name] for name in ("swagger-ui.css", "swagger-ui-bundle.js")}
    return {**needed, **read_folder(_SERVICE / "api" / "docs_page")}


def serve(
    files: Mapping[str, StaticFile], name: str, has: Known, policy: Mapping[str, str]
) -> Response:
    """Serve a file under this content-security policy, or a 304 if the client has it."""
    found = files.get(name)
    if found is None:
        raise Problem(problems.NO_PAGE_FILE, name=name)
    header = "; ".join(" ".join(directive) for directive in policy.items())
    headers = {**_HEADERS, "Content-Security-Policy": header, "ETag": found.tag}
    if has.has(found.tag):
        return not_modified(headers)
    return Response(found.content, headers={**headers, "Content-Type": found.media_type})
