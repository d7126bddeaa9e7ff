"""Who makes a request, as the routes see it; `access.key_guard` finds out before they run."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Final

from fastapi import Depends, Request

from plateau.farm.ledger.api_keys import ApiKey, Role
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.problem import Problem


@dataclass(frozen=True)
class Caller:
    """Who made a request."""

    key: ApiKey | None  #: None where the API is open
    #: Whether the key still opens the API; long-lived streams ask again.
    is_welcome: Callable[[], bool] = field(default=lambda: True, compare=False, repr=False)

    @property
    def id(self) -> str:
        """The key's id, which jobs note as their owner; "" where the API is open."""
        return "" if self.key is None else self.key.id

    @property
    def name(self) -> str:
        """The name of the caller in a job's story."""
        return "a user" if self.key is None else self.key.name

    @property
    def upload_bytes(self) -> int | None:
        """The key's own limit on uploads; None where it has none."""
        return None if self.key is None else self.key.limits.upload_bytes

    def made(self, owner: str | None) -> bool:
        """Whether the caller is this owner; all callers of an open API are one."""
        return self.id == (owner or "")

    def may_steer(self, owner: str | None) -> bool:
        """Whether the caller may change what belongs to this owner, a key's id."""
        return self.key is None or self.key.role is Role.ADMIN or owner == self.key.id

    def check_may_steer_workers(self) -> None:
        """Raise the problem unless the caller may drain and resume workers."""
        if self.key is not None and self.key.role is not Role.ADMIN:
            raise Problem(
                problems.WORKERS_ARE_SHARED,
                key=self.key.name,
                role=self.key.role.value,
                needed=Role.ADMIN.value,
            )

    def check_may_steer(self, job_id: str, owner: str | None) -> None:
        """Raise the problem unless the caller may change this owner's job."""
        if not self.may_steer(owner):
            kind = problems.NOT_YOUR_JOB if owner else problems.JOB_OF_NO_KEY
            raise Problem(kind, job_id=job_id)


#: The caller of an open API.
ANYBODY: Final = Caller(None)


async def _caller(request: Request) -> Caller:
    # A coroutine: FastAPI would run a plain function in a thread.
    found: Caller = getattr(request.state, "caller", ANYBODY)
    return found


#: Who makes the request, as a route takes it.
CallerOf = Annotated[Caller, Depends(_caller)]
