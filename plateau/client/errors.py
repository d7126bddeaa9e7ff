"""Errors of calls to the service.

::

    ClientError
    ├── BadUrl        the URL is malformed
    ├── BadKey        the API key is malformed
    ├── Unreachable   no service answers at the URL
    ├── NotPlateau    the answer is not that of a service of a known version
    ├── Damaged       a received file is not what the service sent
    ├── BadId         a shortened id is that of no job, or of several
    ├── ApiError      the service answered with a problem
    │   ├── UnknownJob    unknown-job
    │   ├── UnknownScene  unknown-scene
    │   ├── NoImageYet    no-image-yet
    │   ├── BrokenScene   broken-scene
    │   ├── InvalidSpec   invalid-spec
    │   └── NotAllowed    no or no good API key, or one without the permission
    └── TimedOut      the job was not finished in time; also a TimeoutError
"""

from typing import Any, Final

from pydantic import ValidationError

from plateau.errors import PlateauError
from plateau.farm.model import errors, input_errors


class ClientError(PlateauError):
    """A call to the service failed; the message says what to do."""


class BadUrl(ClientError):
    """The URL is malformed."""

    def __init__(self, url: str) -> None:
        super().__init__(
            f"{url!r} is not the URL of a service: write it as http://127.0.0.1:8713, "
            "with --url or in PLATEAU_URL"
        )


class BadKey(ClientError):
    """The API key is malformed; the message does not show it."""

    def __init__(self) -> None:
        super().__init__(
            "the API key has characters that no key has: give it as `plateau keys create` printed "
            "it, in PLATEAU_KEY or PLATEAU_KEY_FILE"
        )


class Unreachable(ClientError):
    """No service answers at the URL."""

    def __init__(self, url: str, why: object) -> None:
        super().__init__(
            f"no Plateau service answers at {url} ({why}); "
            "start one with `plateau up`, or name it by --url or PLATEAU_URL"
        )


class NotPlateau(ClientError):
    """The answer is not that of a Plateau service of a known version."""

    def __init__(self, url: str, answer: str) -> None:
        super().__init__(
            f"what answers at {url} is no Plateau service of this version ({answer}); "
            "check --url or PLATEAU_URL"
        )


class Damaged(ClientError):
    """A received file is not what the service sent."""

    def __init__(self, path: str) -> None:
        super().__init__(
            f"{path} was damaged on its way here: its SHA-256 is not the one that the service "
            "sent; fetch it again, and check the network and its proxies if that recurs"
        )


class ApiError(ClientError):
    """The service answered with a problem.

    Attributes
    ----------
    status
        The HTTP status.
    slug
        The kind of problem, such as ``unknown-job``; docs/api.md lists them.
    problem
        The whole problem document (RFC 9457).
    retry_after_s
        The wait before a repeated call that the service asks for; 0 for none.
    """

    def __init__(self, status: int, problem: dict[str, Any], *, retry_after_s: float = 0.0) -> None:
        super().__init__(problem.get("detail") or problem.get("title") or f"HTTP status {status}")
        self.status = status
        self.slug = str(problem.get("type", "")).rpartition("/")[2]
        self.problem = problem
        self.retry_after_s = retry_after_s


class UnknownJob(ApiError):
    """There is no such job."""


class UnknownScene(ApiError):
    """No scene with this SHA-256 is stored."""


class NoImageYet(ApiError):
    """Nothing of the job can be seen yet."""


class BrokenScene(ApiError):
    """The scene is not allowed, or not whole."""


class InvalidSpec(ApiError, errors.InvalidSpec):
    """A field of the spec is unknown, or has a value that is not allowed."""


def invalid_spec(error: ValidationError) -> InvalidSpec:
    """Return the error of a spec that is refused before it is sent: the service would say so."""
    located = [(one["loc"], one) for one in error.errors(include_url=False)]
    wrong = [
        {"field": ".".join(filter(None, ("spec", field))), "message": message}
        for field, message in input_errors.by_field(located, with_values=True).items()
    ]
    words = "; ".join(f"{one['field']}: {one['message']}" for one in wrong)
    return InvalidSpec(
        422, {"type": "/problems/invalid-spec", "status": 422, "detail": words, "errors": wrong}
    )


class NotAllowed(ApiError):
    """The service requires an API key, or a better one."""


_BY_SLUG: Final[dict[str, type[ApiError]]] = {
    "unknown-job": UnknownJob,
    "unknown-scene": UnknownScene,
    "no-image-yet": NoImageYet,
    "broken-scene": BrokenScene,
    "invalid-spec": InvalidSpec,
}
_NOT_ALLOWED: Final = frozenset({401, 403})


def api_error(status: int, problem: dict[str, Any], *, retry_after_s: float = 0.0) -> ApiError:
    """The error for an answer, of the class for its kind of problem."""
    slug = str(problem.get("type", "")).rpartition("/")[2]
    other = NotAllowed if status in _NOT_ALLOWED else ApiError
    return _BY_SLUG.get(slug, other)(status, problem, retry_after_s=retry_after_s)


class BadId(ClientError):
    """A shortened id is that of no job, or of several."""


class TimedOut(ClientError, TimeoutError):
    """The job was not finished in time; it continues."""

    def __init__(self, what: str, timeout_s: float) -> None:
        super().__init__(
            f"{what} is not finished after {timeout_s:g} s and continues: wait for it again, "
            "or cancel it"
        )
