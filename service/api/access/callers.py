"""Who makes a request, as the routes see it: found out by `access.key_guard` before them."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Final

from fastapi import Depends, Request

from plateau.farm.ledger.api_keys import ApiKey, Role
from plateau.service.api.problems.problem import NOT_YOUR_JOB, ROLE_TOO_LOW, Problem


@dataclass(frozen=True)
class Caller:
    """The key that came with a request; None where the API is open."""

    key: ApiKey | None
    #: Whether it still opens the API: for who is served for long.
    is_welcome: Callable[[], bool] = field(default=lambda: True, compare=False, repr=False)

    @property
    def id(self) -> str:
        """The key's id, as jobs note their owner: "" where the API is open."""
        return "" if self.key is None else self.key.id

    @property
    def name(self) -> str:
        """What a job's story calls who steered it."""
        return "a user" if self.key is None else self.key.name

    @property
    def upload_bytes(self) -> int | None:
        """The largest upload that the key may bring; None where it has no limit of its own."""
        return None if self.key is None else self.key.limits.upload_bytes

    def made(self, owner: str | None) -> bool:
        """Whether it made what belongs to the owner; where the API is open, all are one."""
        return self.id == (owner or "")

    def may_steer(self, owner: str | None) -> bool:
        """Whether it may change what belongs to the owner, a key's id: its own, or all as admin."""
        if self.key is None or self.key.role is Role.ADMIN:
            return True
        return owner == self.key.id

    def check_may_steer_workers(self) -> None:
        """Return where it may tell workers what to do; raise the problem where it may not."""
        if self.key is not None and self.key.role is not Role.ADMIN:
            raise Problem(
                ROLE_TOO_LOW,
                f"workers serve every key, so only one with the role {Role.ADMIN.value} may steer "
                f"them, and the key {self.key.name!r} has the role {self.key.role.value}",
                role=self.key.role.value,
                needed=Role.ADMIN.value,
            )

    def check_may_steer(self, job_id: str, owner: str | None) -> None:
        """Return where it may change the job of this owner; raise the problem where it may not."""
        if not self.may_steer(owner):
            raise Problem(NOT_YOUR_JOB, f"job {job_id} {not_yours(owner)}", job_id=job_id)


def not_yours(owner: str | None) -> str:
    """Why a key may not change what belongs to the owner, in words behind the thing's name."""
    if owner:
        return "belongs to another key; only that key, or one with the role admin, may change it"
    return "was made without a key; only a key with the role admin may change it"


#: Who calls an open API.
ANYBODY: Final = Caller(None)


async def caller(request: Request) -> Caller:
    """Who makes the request; no function, as `plateau.service.api.parts.parts` is none."""
    found: Caller = getattr(request.state, "caller", ANYBODY)
    return found


#: Who makes the request, as a route takes it.
CallerOf = Annotated[Caller, Depends(caller)]
