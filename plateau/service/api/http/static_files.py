"""Static files, served from memory with a content-security policy."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from fastapi import Response

from plateau.service.api.http.etags import REVALIDATE, Known, not_modified, strong
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.problem import Problem

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


#: The base of a page's policy: it runs its own scripts and talks to this API only.
OWN_ONLY: Final = {
    "default-src": "'none'",
    "script-src": "'self'",
    "connect-src": "'self'",
    "base-uri": "'none'",
    "form-action": "'none'",
    "frame-ancestors": "'none'",
}


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
