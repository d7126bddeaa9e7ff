"""Conditional GET: a client that already has a representation is answered 304, without it."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Final

from fastapi import Depends, Header, Response
from pydantic import WithJsonSchema

from plateau.farm.model.job import Job

#: For what may change: a cache keeps it, and validates it before each use.
REVALIDATE: Final = "no-cache"
#: For what no longer changes, such as the images of a finished job. The day's limit keeps a browser
#: from showing for ever what the farm has forgotten. No shared cache may keep it.
FINAL: Final = "private, max-age=86400"

_TAG: Final = re.compile(r'"[\x21\x23-\x7e\x80-\xff]*"')

NOT_MODIFIED: Final[dict[int | str, dict[str, Any]]] = {
    304: {
        "description": "`If-None-Match` names the representation that would be sent",
        "headers": {"ETag": {"schema": {"type": "string"}}},
    }
}


def strong(*parts: str | int) -> str:
    """The strong entity tag of these parts, which hold no quotes, spaces or control characters."""
    return f'"{"-".join(map(str, parts))}"'


@dataclass(frozen=True)
class Known:
    """The representations that a request's ``If-None-Match`` names."""

    lines: tuple[str, ...] = ()  #: of the header: lists of tags, or ``*``, which matches them all

    def has(self, tag: str) -> bool:
        """Whether the header names this tag; W/ does not count (RFC 9110, section 13.1.2)."""
        text = ",".join(self.lines)
        return text.strip() == "*" or tag in _TAG.findall(text)


async def _known(
    if_none_match: Annotated[
        list[str] | None,  # one entry for each header line; OpenAPI describes them as one string
        WithJsonSchema({"type": "string", "examples": ['"0000400-7-image.png"']}),
        Header(description="`ETag`s of earlier answers, or `*`; a match is answered 304"),
    ] = None,
) -> Known:
    return Known(tuple(if_none_match or ()))


#: What the client already has, as a route with an ``ETag`` takes it.
IfNoneMatch = Annotated[Known, Depends(_known)]


def cache_control(job: Job) -> str:
    """The ``Cache-Control`` of a job's files, for a job that was read before the files were."""
    return REVALIDATE if job.finished_at is None else FINAL


def not_modified(headers: Mapping[str, str]) -> Response:
    """A 304 with the caching headers of the 200."""
    kept = {name: headers[name] for name in ("ETag", "Cache-Control") if name in headers}
    return Response(status_code=304, headers=kept)
