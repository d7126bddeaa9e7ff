"""What the key of a request is, for a page or a program that wants to know what it may do."""

from typing import Final

from fastapi import APIRouter
from pydantic import BaseModel, ConfigDict, Field
from pydantic.config import JsonDict

from plateau.farm.ledger.api_keys import KeyLimits, Role
from plateau.farm.wire import examples
from plateau.service.api.access.callers import CallerOf
from plateau.service.api.problems.problem import documented

router = APIRouter(tags=["farm"])

_EXAMPLE: Final[JsonDict] = {
    "id": examples.KEY_ID,
    "name": "nightly",
    "role": "submitter",
    "limits": {
        "requests_per_minute": 1200,
        "burst": 200,
        "upload_bytes": 500_000_000,
        "open_jobs": 10_000,
        "scenes_bytes": 53_687_091_200,
    },
}


class KeyView(BaseModel):
    """The key that a request came with."""

    model_config = ConfigDict(extra="ignore", json_schema_extra={"examples": [_EXAMPLE]})

    id: str | None = Field(description="`owner` of the jobs that it makes; null without a key")
    name: str | None
    role: Role = Field(description="what the caller may do; `admin` where the service is open")
    limits: KeyLimits | None = Field(description="how much; null without a key")


@router.get("/v1/key", responses=documented())
def get_key(who: CallerOf) -> KeyView:
    """Show what the request's key may do; where the service is open, anybody may do all."""
    if who.key is None:
        return KeyView(id=None, name=None, role=Role.ADMIN, limits=None)
    return KeyView(id=who.key.id, name=who.key.name, role=who.key.role, limits=who.key.limits)
