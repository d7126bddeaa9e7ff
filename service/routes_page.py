"""The web page: its files as they lie in ``service/page``, nothing built, nothing from elsewhere.

The page is a client of the API like any other. What it may do is written in its headers: run its
own scripts, talk to this API, show pictures from it, and nothing else.
"""

import hashlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Final

from fastapi import APIRouter, Depends, Response

from service import problems
from service.etags import REVALIDATE, Known, known, not_modified, strong
from service.problems import Problem

router = APIRouter(include_in_schema=False)

_MEDIA_TYPES: Final = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".LICENSE": "text/plain; charset=utf-8",
}

#: Trusted types without a policy: no text can become markup, whatever a script of ours does.
_POLICY: Final = {
    "default-src": "'none'",
    "script-src": "'self'",
    "style-src": "'self'",
    "img-src": "'self' blob:",
    "connect-src": "'self'",
    "base-uri": "'none'",
    "form-action": "'none'",
    "frame-ancestors": "'none'",
    "require-trusted-types-for": "'script'",
    "trusted-types": "'none'",
}
_HEADERS: Final = {
    "Content-Security-Policy": "; ".join(" ".join(one) for one in _POLICY.items()),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
    "Cache-Control": REVALIDATE,
}

_Known = Annotated[Known, Depends(known)]


@dataclass(frozen=True)
class _File:
    content: bytes
    media_type: str
    tag: str


@router.get("/")
@router.get("/submit")
@router.get("/workers")
@router.get("/jobs/{job_id}")
def page(has: _Known) -> Response:
    """Show the page; which of its screens is shown, it reads from the path."""
    return _answer(_files()["index.html"], has)


@router.get("/page/{name:path}")
def file(name: str, has: _Known) -> Response:
    """Serve a file of the page."""
    found = _files().get(name)
    if found is None:
        raise Problem(problems.UNKNOWN_PATH, f"the page has no file {name!r}")
    return _answer(found, has)


def _answer(found: _File, has: Known) -> Response:
    headers = {**_HEADERS, "ETag": found.tag}
    if has.anything or has.has(found.tag):
        return not_modified(headers)
    return Response(found.content, headers={**headers, "Content-Type": found.media_type})


@cache
def _files() -> dict[str, _File]:
    """The page's files by their paths: some 300 KB, read once."""
    folder = Path(__file__).parent / "page"
    found = {}
    for path in folder.rglob("*"):
        media_type = _MEDIA_TYPES.get(path.suffix)
        if media_type is not None:
            content = path.read_bytes()
            tag = strong(hashlib.sha256(content).hexdigest()[:16])
            found[path.relative_to(folder).as_posix()] = _File(content, media_type, tag)
    return found
