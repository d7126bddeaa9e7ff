"""The header Idempotency-Key: requests with the same key are carried out once."""

import re
from typing import Annotated, Any, Final

from fastapi import Depends, Request, Response

from plateau.farm.ledger.jobs import Created
from plateau.farm.wire import examples
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.problem import Problem

_KEY: Final = re.compile(r"[\x21-\x7e]{1,255}")

#: The header in the OpenAPI document.
PARAMETERS: Final[list[dict[str, Any]]] = [
    {
        "name": "Idempotency-Key",
        "in": "header",
        "required": False,
        "schema": {"type": "string", "pattern": f"^{_KEY.pattern}$"},
        "example": examples.IDEMPOTENCY_KEY,
        "description": "requests with the same key within a day make one job, or the jobs of one "
        "list",
    }
]
#: The header of the answer to a repeated request.
REPLAYED: Final[dict[str, Any]] = {
    "Idempotency-Replayed": {
        "schema": {"const": "true"},
        "description": "only if an earlier request with this key made the job",
    }
}

#: The headers of an answer that made a job.
NEW_JOB: Final[dict[str, Any]] = {
    **REPLAYED,
    "Location": {"schema": {"type": "string"}, "description": "path of the new job"},
}


def idempotency_key(request: Request) -> str:
    """The request's key, or ""."""
    given = request.headers.get("idempotency-key")
    if given is None:
        return ""
    if not _KEY.fullmatch(given):
        raise Problem(problems.BAD_IDEMPOTENCY_KEY)
    return given


#: The request's key, as a route takes it.
IdempotencyKey = Annotated[str, Depends(idempotency_key)]


def settle(created: Created, key: str, response: Response) -> None:
    """Mark the answer to a repeated request; refuse a key that another request has used."""
    if created.conflict:
        raise Problem(problems.KEY_REUSED, key=key, job_id=created.job.id)
    if created.repeated:
        response.headers["Idempotency-Replayed"] = "true"
