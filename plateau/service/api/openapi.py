"""The API's OpenAPI document, corrected where the framework's differs from what is served."""

from collections.abc import Iterator
from copy import deepcopy
from itertools import chain
from typing import Any, Final

from fastapi import FastAPI, Request
from fastapi.dependencies.models import Dependant

from plateau.farm.model.spec import BatchSpec
from plateau.service.api.access.key_guard import needs_key
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import documented
from plateau.service.api.problems.problem import MEDIA_TYPE, Problem, ProblemDetails

#: Problems of every route.
_ANYWHERE: Final = documented(
    problems.MALFORMED_REQUEST, problems.INTERNAL_ERROR, problems.UNREADABLE_JOB, store=False
)
#: Problems of routes that may need a key.
_GUARDED: Final = documented(
    problems.NO_KEY,
    problems.BAD_KEY,
    problems.FOREIGN_HOST,
    problems.FOREIGN_ORIGIN,
    problems.ROLE_TOO_LOW,
)
_KEY: Final = "api_key"
_KEYS: Final[dict[str, Any]] = {
    _KEY: {
        "type": "http",
        "scheme": "bearer",
        "description": "A key as `plateau keys create` shows it once. Not wanted by a service that "
        "listens on its own machine only and for which none was ever made. To look takes the role "
        "`viewer`, to submit jobs and to change one's own `submitter`, to change others' `admin`.",
    }
}
#: Problems of routes that take a body.
_WITH_BODY: Final = documented(problems.UPLOAD_TOO_LARGE, store=False)
#: The framework's schemas for invalid requests, which this API never answers with.
_FOREIGN: Final = ("HTTPValidationError", "ValidationError")


class DescribedAPI(FastAPI):
    """An application whose OpenAPI document describes exactly what is served."""

    def openapi(self) -> dict[str, Any]:
        """The document, made once."""
        if self.openapi_schema is None:
            self.openapi_schema = _corrected(super().openapi())
        return self.openapi_schema


def _corrected(document: dict[str, Any]) -> dict[str, Any]:
    schemas = document.setdefault("components", {}).setdefault("schemas", {})
    details = ProblemDetails.model_json_schema(ref_template="#/components/schemas/{model}")
    schemas["ProblemDetails"] = details
    many = BatchSpec.model_json_schema(ref_template="#/components/schemas/{model}")
    for name, schema in {**many.pop("$defs", {}), "BatchSpec": many}.items():
        schemas.setdefault(name, schema)
    document["components"]["securitySchemes"] = _KEYS
    for name in _FOREIGN:
        schemas.pop(name, None)
    for operations in document.get("webhooks", {}).values():
        for operation in operations.values():
            _own_answers(operation)
    for path, operations in document["paths"].items():
        guarded = needs_key(path)
        for operation in operations.values():
            if guarded:
                operation["security"] = [{_KEY: []}]
            answers = _own_answers(operation)
            more = [_ANYWHERE]
            if guarded:
                more.append(_GUARDED)
            if "requestBody" in operation:
                more.append(_WITH_BODY)
            for status, answer in chain.from_iterable(one.items() for one in more):
                _add(answers, str(status), answer)
    return document


def _add(answers: dict[str, Any], status: str, answer: dict[str, Any]) -> None:
    """Add the problems of an answer to those that an operation documents for this status."""
    there = answers.get(status)
    if there is None:
        answers[status] = deepcopy(answer)
        return
    known = there["content"][MEDIA_TYPE]["examples"]
    new = {
        slug: one
        for slug, one in answer["content"][MEDIA_TYPE]["examples"].items()
        if slug not in known
    }
    if new:
        known.update(new)
        there["description"] += f"; {answer['description']}"


def _own_answers(operation: dict[str, Any]) -> dict[str, Any]:
    """An operation's answers, from which those of the framework are removed."""
    answers: dict[str, Any] = operation["responses"]
    for status, answer in list(answers.items()):
        if _FOREIGN[0] in str(answer.get("content")):
            del answers[status]
    return answers


async def refuse_unknown_parameters(request: Request) -> None:
    """Refuse an unknown query parameter of a route that has some.

    A filter with a misspelt name would filter nothing. On a route without parameters a page may add
    one to bypass a cache.
    """
    # From the route, because the OpenAPI document takes half a second to make.
    known = list(_query_parameters(request.scope["route"].dependant))
    unknown = sorted(set(request.query_params) - set(known)) if known else []
    if unknown:
        message = f"there is no such parameter; there are {', '.join(known)}"
        raise Problem(
            problems.UNKNOWN_PARAMETERS,
            first=unknown[0],
            known=", ".join(known),
            errors=[{"field": name, "message": message} for name in unknown],
        )


def _query_parameters(dependant: Dependant) -> Iterator[str]:
    """The names of the query parameters of a route and of its dependencies."""
    yield from (field.alias for field in dependant.query_params)
    yield from chain.from_iterable(map(_query_parameters, dependant.dependencies))
