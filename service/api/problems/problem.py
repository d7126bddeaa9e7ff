"""RFC 9457 problem details: every error of the API has a stable type and says what to do."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict, Field
from starlette.exceptions import HTTPException

from plateau.farm.wire import examples

MEDIA_TYPE: Final = "application/problem+json"

#: When a client may try again while Redis or the blob store is away, in seconds.
_RETRY_AFTER_S: Final = 2

#: What is answered to a client that has gone; nobody reads it, but the metrics count it.
CLIENT_GONE: Final = 499

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ProblemType:
    """One kind of problem: the last part of its `type`, its status and its title."""

    slug: str
    status: int
    title: str

    @property
    def uri(self) -> str:
        """The problem's ``type``; the API answers it with what the type means."""
        return f"/problems/{self.slug}"


MALFORMED_REQUEST: Final = ProblemType("malformed-request", 400, "The request cannot be read")
FOREIGN_HOST: Final = ProblemType("foreign-host", 403, "This service answers this machine only")
FOREIGN_ORIGIN: Final = ProblemType("foreign-origin", 403, "Other web sites may not call this API")
NO_KEY: Final = ProblemType("no-key", 401, "An API key is needed")
BAD_KEY: Final = ProblemType("bad-key", 401, "The API key is not valid here")
ROLE_TOO_LOW: Final = ProblemType("role-too-low", 403, "The key's role does not allow this")
NOT_YOUR_JOB: Final = ProblemType("not-your-job", 403, "The job is not this key's")
NOT_YOUR_STUDY: Final = ProblemType("not-your-study", 403, "The study is not this key's")
UNKNOWN_PATH: Final = ProblemType("unknown-path", 404, "There is nothing here")
UNKNOWN_JOB: Final = ProblemType("unknown-job", 404, "There is no such job")
UNKNOWN_WORKER: Final = ProblemType("unknown-worker", 404, "There is no such worker")
UNKNOWN_BATCH: Final = ProblemType("unknown-batch", 404, "There is no such batch")
NO_IMAGE_YET: Final = ProblemType("no-image-yet", 404, "The job has no such image yet")
UNKNOWN_POINT: Final = ProblemType("unknown-point", 404, "The curve has no such point")
UNKNOWN_SLICE: Final = ProblemType("unknown-slice", 404, "The slice is not stored")
UNKNOWN_DELIVERY: Final = ProblemType("unknown-delivery", 404, "The job has no such delivery")
UNKNOWN_STUDY: Final = ProblemType("unknown-study", 404, "There is no such study")
UNKNOWN_OBSERVER: Final = ProblemType("unknown-observer", 404, "There is no such observer")
UNKNOWN_TRIAL: Final = ProblemType("unknown-trial", 404, "The observer is shown no such pair")
METHOD_NOT_ALLOWED: Final = ProblemType(
    "method-not-allowed", 405, "The path does not take this method"
)
NOT_ACCEPTABLE: Final = ProblemType(
    "not-acceptable", 406, "The answer does not come in that format"
)
CANNOT_CANCEL: Final = ProblemType("cannot-cancel", 409, "The job has already ended")
CANNOT_PAUSE: Final = ProblemType("cannot-pause", 409, "The job is not rendering")
CANNOT_RESUME: Final = ProblemType("cannot-resume", 409, "The job is not paused")
CANNOT_CONTINUE: Final = ProblemType(
    "cannot-continue", 409, "The job cannot be continued like this"
)
CANNOT_MERGE: Final = ProblemType("cannot-merge", 409, "That image cannot be made again")
CANNOT_STUDY: Final = ProblemType("cannot-study", 409, "The study cannot be made like this")
UNEVEN_BATCH: Final = ProblemType("uneven-batch", 409, "The job would stop unlike its batch")
TOO_MANY_NEEDS: Final = ProblemType(
    "too-many-needs", 409, "Jobs need too many different pools and tags"
)
JOB_ENDED: Final = ProblemType("job-ended", 409, "The job has ended and cannot be changed")
TOO_MANY_SCENES: Final = ProblemType(
    "too-many-scenes", 403, "The key has stored as much of scenes as it may"
)
UPLOAD_TOO_LARGE: Final = ProblemType("upload-too-large", 413, "The upload is too large")
NOT_MULTIPART: Final = ProblemType("not-multipart", 415, "The body is not multipart/form-data")
INVALID_REQUEST: Final = ProblemType("invalid-request", 422, "A part of the request is not valid")
INVALID_SPEC: Final = ProblemType("invalid-spec", 422, "The job's spec is not valid")
NO_SCENE: Final = ProblemType("no-scene", 422, "The request has no scene")
UNKNOWN_SCENE: Final = ProblemType("unknown-scene", 422, "No such scene is stored")
BROKEN_SCENE: Final = ProblemType("broken-scene", 422, "The scene was refused")
KEY_REUSED: Final = ProblemType(
    "idempotency-key-reused", 422, "The idempotency key was used for another request"
)
TOO_MANY_REQUESTS: Final = ProblemType("too-many-requests", 429, "The key makes too many requests")
TOO_MANY_JOBS: Final = ProblemType("too-many-jobs", 429, "The key has too many open jobs")
INTERNAL_ERROR: Final = ProblemType("internal-error", 500, "The service failed")
UNREADABLE_JOB: Final = ProblemType("unreadable-job", 500, "The job cannot be read")
SPOILED_FILE: Final = ProblemType("spoiled-file", 500, "The stored file is damaged")
BUSY: Final = ProblemType("busy", 503, "Too many requests for this at once")
STORE_UNAVAILABLE: Final = ProblemType(
    "store-unavailable", 503, "Redis or the blob store is not available"
)

#: Every type, by its slug.
TYPES: Final[dict[str, ProblemType]] = {
    value.slug: value for value in tuple(globals().values()) if isinstance(value, ProblemType)
}

_SCHEMA: Final = {"$ref": "#/components/schemas/ProblemDetails"}


class FieldError(BaseModel):
    """One field that was refused."""

    field: str = Field(description="the field's name, with dots where it is nested")
    message: str


class ProblemDetails(BaseModel):
    """A problem as RFC 9457 describes it; some types carry more members."""

    model_config = ConfigDict(extra="allow")

    type: str = Field(description="what kind of problem it is: stable, for programs")
    title: str = Field(description="the kind in words")
    status: int
    detail: str = Field(description="what happened, and what to do about it")
    instance: str = Field(description="the path that was asked for")


class Problem(HTTPException):
    """Raised by a route to answer with a problem.

    Parameters
    ----------
    kind
        Its type.
    detail
        What happened and what to do, in a sentence for people.
    headers
        Headers of the response.
    members
        More members of the problem, for programs.
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
        """What is answered to a request for `path`."""
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
    """The ``responses`` of a route that may answer with these problems, for OpenAPI.

    Parameters
    ----------
    kinds
        The problems.
    store
        Whether the route asks Redis or the blob store, which may be away.
    """
    statuses: dict[int | str, dict[str, Any]] = {}
    for kind in (*kinds, STORE_UNAVAILABLE) if store else kinds:
        line = f"`{kind.uri}`: {kind.title.lower()}"
        known = statuses.setdefault(
            kind.status, {"content": {MEDIA_TYPE: {"schema": _SCHEMA, "examples": {}}}}
        )
        known["description"] = "; ".join(filter(None, (known.get("description"), line)))
        known["content"][MEDIA_TYPE]["examples"][kind.slug] = {"value": _example(kind)}
    return statuses


def _example(kind: ProblemType) -> dict[str, Any]:
    return Problem(kind, examples.PROBLEM_DETAILS[kind.slug]).body(f"/v1/jobs/{examples.JOB_ID}")


def unavailable(method: str, path: str, error: Exception) -> Problem:
    """What is answered to a request while Redis or the blob store is away; the log has it too."""
    _log.warning("%s %s: %s", method, path, error)
    headers = {"Retry-After": str(_RETRY_AFTER_S)}
    words = str(error) or "Redis does not answer"
    return Problem(STORE_UNAVAILABLE, f"{words}; try again shortly", headers=headers)
