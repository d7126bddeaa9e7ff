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
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import unavailable
from plateau.service.api.problems.problem import Problem, ProblemType
from plateau.service.api.problems.spec_checks import invalid_request
from plateau.service.api.stored_files import SpoiledBlob

#: The problem of a refused transition, by the state aimed at.
_REFUSALS: Final = {
    JobState.CANCELLED: problems.CANNOT_CANCEL,
    JobState.PAUSED: problems.CANNOT_PAUSE,
    JobState.RENDERING: problems.CANNOT_RESUME,
}

#: Errors that are a problem as they are: it has their message and fields.
_AS_THEY_ARE: Final[dict[type[Exception], ProblemType]] = {
    JobNotFound: problems.UNKNOWN_JOB,
    UnreadableJob: problems.UNREADABLE_JOB,
    BatchNotFound: problems.UNKNOWN_BATCH,
    WorkerNotFound: problems.UNKNOWN_WORKER,
    SpoiledBlob: problems.SPOILED_FILE,
    TooManyJobs: problems.TOO_MANY_JOBS,
    TooManyNeeds: problems.TOO_MANY_NEEDS,
    CannotFollow: problems.CANNOT_FOLLOW,
}


def answer_as_they_are(app: FastAPI, errors: Mapping[type[Exception], ProblemType]) -> None:
    """Answer each of these errors with its problem, by the error's message and fields."""

    def answer_as_it_is(request: Request, error: Exception) -> JSONResponse:
        problem = Problem(errors[type(error)], error=error, **vars(error))
        return problem.response(request.url.path)

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
        if problem.kind.slug == problems.UNKNOWN_PATH.slug and _wants_a_page(request):
            return unknown_page()
        return problem.response(request.url.path)

    @app.exception_handler(RequestValidationError)
    def answer_invalid(request: Request, error: RequestValidationError) -> JSONResponse:
        if any(one["type"] == "json_invalid" for one in error.errors()):
            return Problem(problems.MALFORMED_REQUEST).response(request.url.path)
        return invalid_request(error.errors()).response(request.url.path)

    @app.exception_handler(IllegalTransition)
    @app.exception_handler(JobEnded)
    def answer_illegal(request: Request, error: IllegalTransition | JobEnded) -> JSONResponse:
        kind = problems.JOB_ENDED
        if isinstance(error, IllegalTransition):
            kind = _REFUSALS[JobState(error.target)]
        problem = Problem(
            kind,
            job=error.job_id,
            clause=JobState(error.state).clause,
            state=error.state,
            story=error.story,
        )
        return problem.response(request.url.path)

    @app.exception_handler(JobNotEnded)
    def answer_not_ended(request: Request, error: JobNotEnded) -> JSONResponse:
        is_ended = JobState(error.state).ended
        kind = problems.RESULTS_BEING_WRITTEN if is_ended else problems.JOB_NOT_ENDED
        return Problem(kind, job=error.job_id, state=error.state).response(request.url.path)

    @app.exception_handler(Incompatible)  # another API may answer
    @app.exception_handler(StoreUnavailable)
    def answer_unavailable(request: Request, error: StoreUnavailable) -> JSONResponse:
        path, kind = request.url.path, problems.STORE_UNAVAILABLE
        return unavailable(request.method, path, kind, error).response(path)

    @app.exception_handler(ClientDisconnect)
    def answer_nobody(_: Request, __: ClientDisconnect) -> Response:
        return Response(status_code=problems.CLIENT_GONE)

    @app.exception_handler(Exception)
    def answer_unexpected(request: Request, _: Exception) -> JSONResponse:
        return Problem(problems.INTERNAL_ERROR).response(request.url.path)


def _wants_a_page(request: Request) -> bool:
    """Whether somebody looks at the answer: a browser that was sent to this path."""
    is_api = request.url.path.startswith(("/v1/", "/problems/", "/page/"))
    accepted = request.headers.get("accept", "")
    return request.method in {"GET", "HEAD"} and "text/html" in accepted and not is_api


def _from_http(request: Request, error: HTTPException) -> Problem:
    if isinstance(error, Problem):
        return error
    path, headers = request.url.path, error.headers
    kind = problems.of_status(error.status_code)
    if kind is problems.MALFORMED_REQUEST and "multipart" in request.headers.get(
        "content-type", ""
    ):
        kind = problems.BROKEN_FORM
    if kind is problems.UNKNOWN_PATH and path.endswith("/"):
        kind = problems.SLASH_AT_END
    if kind is problems.METHOD_NOT_ALLOWED:
        headers = {**(headers or {}), **_allow(request)}
    return Problem(kind, headers, path=path, method=request.method, error=error.detail)


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
