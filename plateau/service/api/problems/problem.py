"""Problems by RFC 9457: every error of the API has a stable type and says what to do."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict, Field
from starlette.exceptions import HTTPException

from plateau.farm.wire import examples

MEDIA_TYPE: Final = "application/problem+json"

#: ``Retry-After`` while Redis or the blob store is away, in seconds.
_RETRY_AFTER_S: Final = 2

#: The status for a client that has disconnected; nobody reads it, but the metrics count it.
CLIENT_GONE: Final = 499

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ProblemType:
    """A kind of problem: the last part of its `type`, its status and its title."""

    slug: str
    status: int
    title: str

    @property
    def uri(self) -> str:
        """The problem's ``type``, a path at which the API explains it."""
        return f"/problems/{self.slug}"


MALFORMED_REQUEST: Final = ProblemType("malformed-request", 400, "Bad request")
FOREIGN_HOST: Final = ProblemType("foreign-host", 403, "Host not allowed")
FOREIGN_ORIGIN: Final = ProblemType("foreign-origin", 403, "Origin not allowed")
NO_KEY: Final = ProblemType("no-key", 401, "API key required")
BAD_KEY: Final = ProblemType("bad-key", 401, "Invalid API key")
ROLE_TOO_LOW: Final = ProblemType("role-too-low", 403, "Insufficient role")
NOT_YOUR_JOB: Final = ProblemType("not-your-job", 403, "Job of another key")
UNKNOWN_PATH: Final = ProblemType("unknown-path", 404, "Not found")
UNKNOWN_JOB: Final = ProblemType("unknown-job", 404, "Unknown job")
UNKNOWN_WORKER: Final = ProblemType("unknown-worker", 404, "Unknown worker")
UNKNOWN_BATCH: Final = ProblemType("unknown-batch", 404, "Unknown batch")
NO_SHOT: Final = ProblemType("no-shot", 404, "Batch is no shot")
NO_IMAGE_YET: Final = ProblemType("no-image-yet", 404, "Image not available")
UNKNOWN_POINT: Final = ProblemType("unknown-point", 404, "Unknown point of the curve")
UNKNOWN_SLICE: Final = ProblemType("unknown-slice", 404, "Slice not stored")
METHOD_NOT_ALLOWED: Final = ProblemType("method-not-allowed", 405, "Method not allowed")
NOT_ACCEPTABLE: Final = ProblemType("not-acceptable", 406, "Not acceptable")
CANNOT_CANCEL: Final = ProblemType("cannot-cancel", 409, "Job already ended")
CANNOT_PAUSE: Final = ProblemType("cannot-pause", 409, "Job not rendering")
CANNOT_RESUME: Final = ProblemType("cannot-resume", 409, "Job not paused")
CANNOT_MERGE: Final = ProblemType("cannot-merge", 409, "Image cannot be reproduced")
TOO_MANY_NEEDS: Final = ProblemType(
    "too-many-needs", 409, "Too many combinations of pools and tags"
)
JOB_ENDED: Final = ProblemType("job-ended", 409, "Job already ended")
JOB_NOT_ENDED: Final = ProblemType("job-not-ended", 409, "Job not ended")
TOO_MANY_SCENES: Final = ProblemType("too-many-scenes", 403, "Scene storage quota exceeded")
UPLOAD_TOO_LARGE: Final = ProblemType("upload-too-large", 413, "Upload too large")
NOT_MULTIPART: Final = ProblemType("not-multipart", 415, "Unsupported media type")
INVALID_REQUEST: Final = ProblemType("invalid-request", 422, "Invalid request")
INVALID_SPEC: Final = ProblemType("invalid-spec", 422, "Invalid job spec")
NO_SCENE: Final = ProblemType("no-scene", 422, "Missing scene")
UNKNOWN_SCENE: Final = ProblemType("unknown-scene", 422, "Unknown scene")
BROKEN_SCENE: Final = ProblemType("broken-scene", 422, "Invalid scene")
KEY_REUSED: Final = ProblemType("idempotency-key-reused", 422, "Idempotency key reused")
TOO_MANY_REQUESTS: Final = ProblemType("too-many-requests", 429, "Too many requests")
TOO_MANY_JOBS: Final = ProblemType("too-many-jobs", 429, "Too many open jobs")
INTERNAL_ERROR: Final = ProblemType("internal-error", 500, "Internal server error")
UNREADABLE_JOB: Final = ProblemType("unreadable-job", 500, "Unreadable job")
SPOILED_FILE: Final = ProblemType("spoiled-file", 500, "Stored file damaged")
BUSY: Final = ProblemType("busy", 503, "Service busy")
STORE_UNAVAILABLE: Final = ProblemType("store-unavailable", 503, "Redis or blob store unavailable")

#: Every type, by its slug.
TYPES: Final[dict[str, ProblemType]] = {
    value.slug: value for value in tuple(globals().values()) if isinstance(value, ProblemType)
}


def of_extension(slug: str, status: int, title: str, example: str) -> ProblemType:
    """Return a type of an extension's, which is listed with all others."""
    TYPES[slug] = ProblemType(slug, status, title)
    examples.PROBLEM_DETAILS[slug] = example
    return TYPES[slug]


_SCHEMA: Final = {"$ref": "#/components/schemas/ProblemDetails"}


class FieldError(BaseModel):
    """One field that was refused."""

    field: str = Field(description="the field's name, with dots where it is nested")
    message: str


class ProblemDetails(BaseModel):
    """A problem by RFC 9457; some types carry more members."""

    model_config = ConfigDict(extra="allow")

    type: str = Field(description="what kind of problem it is: stable, for programs")
    title: str = Field(description="the kind in words")
    status: int
    detail: str = Field(description="what happened, and what to do about it")
    instance: str = Field(description="the path that was asked for")


class Problem(HTTPException):
    """Raised by a route to answer with a problem.

    `detail` says in a sentence what happened and what to do. `members` are further members of the
    problem, for programs.
    """

    def __init__(
        self,
        kind: ProblemType,
        detail: str,
        *,
        headers: Mapping[str, str] | None = None,
        **members: object,
    ) -> None:
        super().__init__(kind.status, detail, dict(headers) if headers else None)
        self.kind = kind
        self.members = members

    def body(self, path: str) -> dict[str, Any]:
        """The JSON of the answer to a request for `path`."""
        return {
            "type": self.kind.uri,
            "title": self.kind.title,
            "status": self.kind.status,
            "detail": self.detail,
            "instance": path,
            **self.members,
        }

    def response(self, path: str) -> JSONResponse:
        """The response to a request for `path`."""
        return JSONResponse(self.body(path), self.kind.status, self.headers, MEDIA_TYPE)


def documented(*kinds: ProblemType, store: bool = True) -> dict[int | str, dict[str, Any]]:
    """The OpenAPI ``responses`` of a route that may answer with these problems.

    `store` adds the problem of a route that uses Redis or the blob store, which may be away.
    """
    statuses: dict[int | str, dict[str, Any]] = {}
    for kind in (*kinds, STORE_UNAVAILABLE) if store else kinds:
        line = f"`{kind.uri}`: {kind.title}"
        known = statuses.setdefault(
            kind.status, {"content": {MEDIA_TYPE: {"schema": _SCHEMA, "examples": {}}}}
        )
        known["description"] = "; ".join(filter(None, (known.get("description"), line)))
        example = Problem(kind, examples.PROBLEM_DETAILS[kind.slug])
        value = example.body(f"/v1/jobs/{examples.JOB_ID}")
        known["content"][MEDIA_TYPE]["examples"][kind.slug] = {"value": value}
    return statuses


def unavailable(method: str, path: str, error: Exception) -> Problem:
    """The problem of a request while Redis or the blob store is away; it is logged too."""
    _log.warning("%s %s: %s", method, path, error)
    headers = {"Retry-After": str(_RETRY_AFTER_S)}
    words = str(error) or "Redis does not answer"
    return Problem(STORE_UNAVAILABLE, f"{words}; try again shortly", headers=headers)
