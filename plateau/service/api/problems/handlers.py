"""Error handlers: every error of a route is answered with a problem."""

from collections.abc import Callable, Mapping
from typing import Final

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.routing import compile_path

from plateau.farm.model.errors import (
    BatchNotFound,
    CannotFollow,
    IllegalTransition,
    Incompatible,
    JobEnded,
    JobNotEnded,
    JobNotFound,
    StoreUnavailable,
    TooManyJobs,
    TooManyNeeds,
    UnreadableJob,
    WorkerNotFound,
)
from plateau.farm.model.states import JobState
from plateau.farm.wire.examples import NOT_JSON
from plateau.service.api.points.stored_files import SpoiledBlob
from plateau.service.api.problems import problem as problems
from plateau.service.api.problems.framework_errors import in_our_words
from plateau.service.api.problems.problem import Problem, ProblemType, unavailable
from plateau.service.api.problems.spec_checks import invalid_field, invalid_request

#: The problem of a refused transition, and what is possible instead, by the state aimed at.
_REFUSALS: Final = {
    JobState.CANCELLED: (problems.CANNOT_CANCEL, "only a job that has not ended can be cancelled"),
    JobState.PAUSED: (
        problems.CANNOT_PAUSE,
        "only a job that is rendering can be paused; a queued one can have a lower priority",
    ),
    JobState.RENDERING: (problems.CANNOT_RESUME, "only a paused job can be resumed"),
}

#: Errors whose own message is the detail: the problem, and a remedy to append.
_AS_THEY_ARE: Final[dict[type[Exception], tuple[ProblemType, str]]] = {
    JobNotFound: (problems.UNKNOWN_JOB, "; GET /v1/jobs lists those there are"),
    UnreadableJob: (problems.UNREADABLE_JOB, ""),
    BatchNotFound: (problems.UNKNOWN_BATCH, "; GET /v1/batches lists those there are"),
    WorkerNotFound: (problems.UNKNOWN_WORKER, "; GET /v1/workers lists those there are"),
    SpoiledBlob: (problems.SPOILED_FILE, ""),
}

#: The problems for the framework's bare statuses.
_BY_STATUS: Final = {
    400: problems.MALFORMED_REQUEST,
    404: problems.UNKNOWN_PATH,
    405: problems.METHOD_NOT_ALLOWED,
}


def answer_as_they_are(
    app: FastAPI, errors: Mapping[type[Exception], tuple[ProblemType, str]]
) -> None:
    """Answer each of these errors with its problem; the detail is its message and the remedy."""

    def answer_as_it_is(request: Request, error: Exception) -> JSONResponse:
        kind, what_to_do = errors[type(error)]
        return Problem(kind, f"{error}{what_to_do}").response(request.url.path)

    for expected in errors:
        app.add_exception_handler(expected, answer_as_it_is)


def add_problem_handlers(app: FastAPI, unknown_page: Callable[[], Response]) -> None:
    """Answer every error with a problem: our own, the framework's and unexpected ones.

    A browser that asks for an unknown path outside the API has `unknown_page` instead.
    """
    answer_as_they_are(app, _AS_THEY_ARE)

    @app.exception_handler(HTTPException)
    def answer_http(request: Request, error: HTTPException) -> Response:
        problem = _from_http(request, error)
        if problem.kind is problems.UNKNOWN_PATH and _wants_a_page(request):
            return unknown_page()
        return problem.response(request.url.path)

    @app.exception_handler(RequestValidationError)
    def answer_invalid(request: Request, error: RequestValidationError) -> JSONResponse:
        if any(one["type"] == "json_invalid" for one in error.errors()):
            problem = Problem(problems.MALFORMED_REQUEST, NOT_JSON)
            return problem.response(request.url.path)
        return invalid_request(error.errors()).response(request.url.path)

    @app.exception_handler(IllegalTransition)
    def answer_illegal(request: Request, error: IllegalTransition) -> JSONResponse:
        kind, possible = _REFUSALS[JobState(error.target)]
        detail = f"job {error.job_id} {JobState(error.state).clause}; {possible}"
        problem = Problem(kind, detail, state=error.state, story=error.story)
        return problem.response(request.url.path)

    @app.exception_handler(JobEnded)
    def answer_ended(request: Request, error: JobEnded) -> JSONResponse:
        clause = JobState(error.state).clause
        detail = f"job {error.job_id} {clause}; only a job that has not ended can be changed"
        problem = Problem(problems.JOB_ENDED, detail, state=error.state, story=error.story)
        return problem.response(request.url.path)

    @app.exception_handler(JobNotEnded)
    def answer_not_ended(request: Request, error: JobNotEnded) -> JSONResponse:
        if JobState(error.state).ended:
            detail = f"the results of job {error.job_id} are being written: try again in a moment"
        else:
            detail = (
                f"job {error.job_id} is {error.state}; only a job that has ended can be deleted or "
                "rendered again: cancel it first"
            )
        problem = Problem(problems.JOB_NOT_ENDED, detail, state=error.state)
        return problem.response(request.url.path)

    @app.exception_handler(Incompatible)  # another API may answer
    @app.exception_handler(StoreUnavailable)
    def answer_unavailable(request: Request, error: StoreUnavailable) -> JSONResponse:
        return unavailable(request.method, request.url.path, error).response(request.url.path)

    @app.exception_handler(TooManyJobs)
    def answer_too_many_jobs(request: Request, error: TooManyJobs) -> JSONResponse:
        detail = f"{error}; wait for one to end, or cancel one"
        problem = Problem(
            problems.TOO_MANY_JOBS, detail, open_jobs=error.open_jobs, limit=error.most
        )
        return problem.response(request.url.path)

    @app.exception_handler(CannotFollow)
    def answer_cannot_follow(request: Request, error: CannotFollow) -> JSONResponse:
        problem = invalid_field(problems.INVALID_SPEC, "spec.after", str(error))
        return problem.response(request.url.path)

    @app.exception_handler(TooManyNeeds)
    def answer_too_many_needs(request: Request, error: TooManyNeeds) -> JSONResponse:
        detail = f"{error}; wait for some to end, or ask for a combination that others have"
        return Problem(problems.TOO_MANY_NEEDS, detail).response(request.url.path)

    @app.exception_handler(ClientDisconnect)
    def answer_nobody(_: Request, __: ClientDisconnect) -> Response:
        return Response(status_code=problems.CLIENT_GONE)

    @app.exception_handler(Exception)
    def answer_unexpected(request: Request, _: Exception) -> JSONResponse:
        detail = "Plateau met an error that it did not expect; the API's log has the details"
        return Problem(problems.INTERNAL_ERROR, detail).response(request.url.path)


def _wants_a_page(request: Request) -> bool:
    """Whether somebody looks at the answer: a browser that was sent to this path."""
    is_api = request.url.path.startswith(("/v1/", "/problems/", "/page/"))
    accepted = request.headers.get("accept", "")
    return request.method in {"GET", "HEAD"} and "text/html" in accepted and not is_api


def _from_http(request: Request, error: HTTPException) -> Problem:
    if isinstance(error, Problem):
        return error
    kind = _BY_STATUS.get(error.status_code)
    if kind is None:
        kind = ProblemType("http-error", error.status_code, "The request failed")
    path, headers = request.url.path, error.headers
    if kind is problems.METHOD_NOT_ALLOWED:
        headers = {**(headers or {}), **_allow(request)}
    details = {
        problems.UNKNOWN_PATH: f"nothing is served at {path}; /docs lists what is"
        + (", without a slash at its end" if path.endswith("/") else ""),
        problems.METHOD_NOT_ALLOWED: f"{path} does not take {request.method}; /docs says what it "
        "takes",
    }
    unknown = f"the request to {path} cannot be answered as it is; /docs says what to send"
    words = details.get(kind) or in_our_words(str(error.detail)) or unknown
    return Problem(kind, words, headers=headers)


def _allow(request: Request) -> dict[str, str]:
    """The ``Allow`` header of a path; the framework's covers only one of its routes."""
    app: FastAPI = request.app
    methods: set[str] = set()
    for path, operations in app.openapi()["paths"].items():
        if compile_path(path)[0].match(request.url.path):
            methods |= {method.upper() for method in operations}
    if "GET" in methods:
        methods.add("HEAD")
    return {"Allow": ", ".join(sorted(methods))} if methods else {}
