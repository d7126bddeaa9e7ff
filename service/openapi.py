"""The API's description of itself, corrected where the framework's differs from what is served."""

from typing import Any, Final

from fastapi import FastAPI, Request

from service import problems
from service.problems import Problem, ProblemDetails, documented

#: What any request may be answered, whatever its route.
_ANYWHERE: Final = documented(
    problems.FOREIGN_HOST, problems.FOREIGN_ORIGIN, problems.INTERNAL_ERROR, store=False
)
#: And a request with a body.
_WITH_BODY: Final = documented(problems.MALFORMED_REQUEST, problems.UPLOAD_TOO_LARGE, store=False)
#: What the framework says that it answers to an invalid request, where a route says nothing.
_FOREIGN: Final = ("HTTPValidationError", "ValidationError")


class DescribedAPI(FastAPI):
    """An application whose OpenAPI document says what is served, and no more."""

    def openapi(self) -> dict[str, Any]:
        """The document, made once."""
        if self.openapi_schema is None:
            self.openapi_schema = _corrected(super().openapi())
        return self.openapi_schema


def _corrected(document: dict[str, Any]) -> dict[str, Any]:
    schemas = document.setdefault("components", {}).setdefault("schemas", {})
    details = ProblemDetails.model_json_schema(ref_template="#/components/schemas/{model}")
    schemas["ProblemDetails"] = details
    for name in _FOREIGN:
        schemas.pop(name, None)
    for path in document["paths"].values():
        for operation in path.values():
            answers = operation["responses"]
            for status, answer in list(answers.items()):
                if _FOREIGN[0] in str(answer.get("content")):
                    del answers[status]
            more = {**_ANYWHERE, **_WITH_BODY} if "requestBody" in operation else _ANYWHERE
            for status, answer in more.items():
                answers.setdefault(str(status), answer)
    return document


async def refuse_unknown_parameters(request: Request) -> None:
    """Refuse a query parameter that the route does not have, where it has some.

    A filter with a slip in its name would be no filter. Where there are none, pages may add what
    makes a URL new to a cache.
    """
    path: str = request.scope["route"].path
    # A route may be left out of the document, as a web page is.
    operation = request.app.openapi()["paths"].get(path, {}).get(request.method.lower(), {})
    known = [one["name"] for one in operation.get("parameters", ()) if one["in"] == "query"]
    unknown = sorted(set(request.query_params) - set(known)) if known else []
    if unknown:
        message = f"there is no such parameter; there are {', '.join(known)}"
        raise Problem(
            problems.INVALID_REQUEST,
            f"{unknown[0]}: {message}",
            errors=[{"field": name, "message": message} for name in unknown],
        )
