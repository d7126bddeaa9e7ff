"""Access by key: which requests need a key, and what its role allows.

The farm's data are under ``/v1/`` and at ``/metrics``. Everything else (health, the description of
the API, the web page's files) is the same for everybody and stays open. Every change of a job is
checked here by its path, so that no route can forget the check; of a batch, job by job where it is
steered.

Each request looks its key up: the first key that is made closes an open API at once, and a revoked
key opens nothing from then on. Long-lived streams look it up again (see `Caller.is_welcome`).
"""

import re
from enum import Enum
from functools import partial
from typing import Final

import anyio
from anyio import CapacityLimiter
from starlette.types import ASGIApp, Receive, Scope, Send

from plateau.farm.ledger.api_keys import ApiKeys, Role
from plateau.farm.model.errors import Incompatible, StoreUnavailable
from plateau.service.api.access.callers import ANYBODY, Caller
from plateau.service.api.access.guards import discard_body, header, refuse_foreign
from plateau.service.api.http.layers import Layer
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.problem import Problem

#: Threads that look up keys; a look-up takes less than a millisecond.
_THREADS: Final = 16

_READING: Final = frozenset({"GET", "HEAD", "OPTIONS"})
_METRICS: Final = "/metrics"
#: Open, because the API's description shows them too, and the page's forms have no key yet.
_FOR_FORMS: Final = frozenset({"/v1/rules", "/v1/spec"})
_JOB: Final = re.compile(r"/v1/jobs/([0-9a-f]{12})(?:/|$)")
_BEARER: Final = re.compile(r"bearer +([^ ].*)", re.IGNORECASE)


class Access(Enum):
    """When an API demands keys; without one it answers this machine only."""

    OPEN = "open"  #: never, as its user asked
    UNTIL_KEYS = "until keys"  #: as soon as a key was ever made
    KEYS = "keys"  #: always, because other machines reach it


class KeyGuard(Layer):
    """Passes on requests that need no key, or whose key allows them."""

    def __init__(self, app: ASGIApp, *, keys: ApiKeys, access: Access) -> None:
        super().__init__(app)
        self._keys = keys
        self._access = access
        self._threads: CapacityLimiter | None = None

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on with its `Caller`, or refuse it."""
        if not needs_key(scope["path"]):
            await self.app(scope, receive, send)
            return
        try:
            caller = await self._caller(scope)
        except Problem as problem:
            await discard_body(scope, receive)
            await problem.response(scope["path"])(scope, receive, send)
        else:
            scope.setdefault("state", {})["caller"] = caller
            await self.app(scope, receive, send)

    async def _caller(self, scope: Scope) -> Caller:
        """Who makes the request, or the problem with it."""
        if self._access is Access.OPEN:
            refuse_foreign(scope)
            return ANYBODY
        if self._threads is None:  # made here, since it belongs to the running loop
            self._threads = CapacityLimiter(_THREADS)
        try:
            return await anyio.to_thread.run_sync(self._looked_up, scope, limiter=self._threads)
        except (Incompatible, StoreUnavailable) as error:
            kind = problems.STORE_UNAVAILABLE
            raise problems.unavailable(scope["method"], scope["path"], kind, error) from error

    def _looked_up(self, scope: Scope) -> Caller:
        shown = _shown_key(scope)
        key = None if shown is None else self._keys.find(shown)
        if shown is None or key is None:
            # Redis is asked first: while it is away, the answer is 503 and not 401.
            if self._keys.any_made() or self._access is Access.KEYS:
                raise Problem(problems.BAD_KEY if shown else problems.NO_KEY)
            refuse_foreign(scope)
            return ANYBODY
        self._keys.note_use(key)
        needed = Role.VIEWER if scope["method"] in _READING else Role.SUBMITTER
        if not key.role.includes(needed):
            raise Problem(
                problems.ROLE_TOO_LOW, key=key.name, role=key.role.value, needed=needed.value
            )
        caller = Caller(key, partial(self._still_opens, shown))
        self._check_job(scope, caller)
        return caller

    def _still_opens(self, shown: str) -> bool:
        """Whether a key that opened the API still does; assumed while Redis is away."""
        try:
            return self._keys.find(shown) is not None
        except StoreUnavailable:
            return True

    def _check_job(self, scope: Scope, caller: Caller) -> None:
        """Raise the problem if the request would change another's job."""
        job = _JOB.match(scope["path"])
        if job is None or scope["method"] in _READING or caller.may_steer(None):
            return
        owner = self._keys.owner_of(job[1])
        if owner is not None:  # the job exists
            caller.check_may_steer(job[1], owner)


def needs_key(path: str) -> bool:
    """Whether the path serves the farm's data, and not the same to everybody."""
    return (path.startswith("/v1/") and path not in _FOR_FORMS) or path == _METRICS


def _shown_key(scope: Scope) -> str | None:
    match = _BEARER.fullmatch((header(scope["headers"], b"authorization") or "").strip())
    return None if match is None else match[1]
