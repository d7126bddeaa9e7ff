"""Conditional GET: who has a representation already is answered 304, without it."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Final

from fastapi import Header, Response
from pydantic import WithJsonSchema

from plateau.farm.model.job import Job

#: It changes while the job runs: kept, but asked for again before each use.
REVALIDATE: Final = "no-cache"
#: The images of a finished job change no more. After a day they are asked for again, so that a
#: browser does not show for ever what the farm has forgotten; and they are for one person's eyes.
FINAL: Final = "private, max-age=86400"

_TAG: Final = re.compile(r'(?:W/)?("[\x21\x23-\x7e\x80-\xff]*")')
_LIST: Final = re.compile(rf"[ \t,]*(?:{_TAG.pattern}[ \t]*(?:,[ \t,]*|$))+")

NOT_MODIFIED: Final[dict[int | str, dict[str, Any]]] = {
    304: {
        "description": "`If-None-Match` names what would be sent",
        "headers": {"ETag": {"schema": {"type": "string"}}},
    }
}


def strong(*parts: str | int) -> str:
    """The strong entity tag made of these parts; they have no quotes, spaces or controls."""
    return f'"{"-".join(map(str, parts))}"'


@dataclass(frozen=True)
class Known:
    """The representations that a request's ``If-None-Match`` names."""

    tags: frozenset[str]  #: opaque tags with their quotes: W/ makes no difference here
    anything: bool  #: it is ``*``: whatever there is

    def has(self, tag: str) -> bool:
        """Whether this representation is named; ``*`` names it only once it is known to exist."""
        return tag in self.tags


def read_if_none_match(lines: list[str]) -> Known:
    """What the header's lines name: a list, or ``*``; nothing where they are neither.

    References
    ----------
    RFC 9110, sections 8.8.3 and 13.1.2: tags are compared weakly.
    """
    text = ",".join(lines)
    if text.strip(" \t") == "*":
        return Known(frozenset(), anything=True)
    if not _LIST.fullmatch(text):
        return Known(frozenset(), anything=False)
    return Known(frozenset(_TAG.findall(text)), anything=False)


async def known(
    if_none_match: Annotated[
        list[str] | None,  # its lines, which are documented as the one that they mean
        WithJsonSchema({"type": "string", "examples": ['"0000400-7-image.png"']}),
        Header(
            description="`ETag`s of earlier answers, or `*`: 304 where one is that of this answer"
        ),
    ] = None,
) -> Known:
    """What a request has already; a dependency of routes with an ``ETag``."""
    return read_if_none_match(if_none_match or [])


def cache_control(job: Job) -> str:
    """How long what comes of a job may be used without asking; it must be read before that is."""
    return REVALIDATE if job.finished_at is None else FINAL


def not_modified(headers: Mapping[str, str]) -> Response:
    """A 304 with what the 200 would say of its caching."""
    kept = {name: headers[name] for name in ("ETag", "Cache-Control", "Vary") if name in headers}
    return Response(status_code=304, headers=kept)
