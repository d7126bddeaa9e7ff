"""The door: which requests need a key, what the key's role allows, and how often it may be used.

What a farm knows is under ``/v1/`` and at ``/metrics``; all else (health, the description of the
API, the web page's own files) is the same for everybody and stays open. Every change of a job is
checked here by its path, so that no route can forget it.

Keys are looked up for each request: the first key that is made closes an open API at once, and a
revoked one opens nothing from then on. Who is served for long is asked about again (see
`Caller.is_welcome`).
"""

import math
import re
from enum import Enum
from functools import partial
from typing import Final

import anyio
from anyio import CapacityLimiter
from starlette.types import ASGIApp, Receive, Scope, Send

from plateau.farm.ledger.allowance import Allowance
from plateau.farm.ledger.api_keys import ApiKey, ApiKeys, Role, opens
from plateau.farm.model.errors import Incompatible, StoreUnavailable
from plateau.service.api.access.callers import ANYBODY, Caller
from plateau.service.api.access.guards import discard_body, header, refuse_foreign
from plateau.service.api.http.layers import Layer
from plateau.service.api.problems import problem as problems
from plateau.service.api.problems.problem import Problem

#: More would only wait for each other: a look takes less than a millisecond.
_THREADS: Final = 16
#: Prometheus gives a scrape up after 10 s, so a silent Redis may not take them all.
_METRICS_PATIENCE_S: Final = 2.0

_READING: Final = frozenset({"GET", "HEAD", "OPTIONS"})
_METRICS: Final = "/metrics"
#: They are in the API's description too, which is open; and the page's forms come without a key.
_RULES: Final = "/v1/rules"
_JOB: Final = re.compile(r"/v1/jobs/([0-9a-f]{12})(?:/|$)")
_BEARER: Final = re.compile(r"bearer +([^ ].*)", re.IGNORECASE)


class Access(Enum):
    """Where an API wants keys."""

    OPEN = "open"  #: nowhere: it was asked to, and answers this machine only
    UNTIL_KEYS = "until keys"  #: as soon as one was ever made; till then this machine only
    KEYS = "keys"  #: for every request: other machines reach it


class KeyGuard(Layer):
    """Lets through requests that need no key, or bring one that allows them."""

    def __init__(
        self, app: ASGIApp, *, keys: ApiKeys, allowance: Allowance, access: Access
    ) -> None:
        super().__init__(app)
        self._keys = keys
        self._allowance = allowance
        self._access = access
        self._threads: CapacityLimiter | None = None
        # For the metrics while Redis is away: what it said when it last answered.
        self._wanted = access is Access.KEYS
        self._seen: dict[str, ApiKey] = {}

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on with its `Caller`, or answer why not."""
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
        if self._threads is None:  # it belongs to the loop that serves
            self._threads = CapacityLimiter(_THREADS)
        metrics = scope["path"] == _METRICS
        try:
            with anyio.fail_after(_METRICS_PATIENCE_S if metrics else None):
                return await anyio.to_thread.run_sync(
                    self._looked_up, scope, limiter=self._threads, abandon_on_cancel=metrics
                )
        except (Incompatible, StoreUnavailable, TimeoutError) as error:
            if metrics and self._is_remembered(scope):
                return ANYBODY
            raise problems.unavailable(scope["method"], scope["path"], error) from error

    def _looked_up(self, scope: Scope) -> Caller:
        shown = _shown_key(scope)
        key = None if shown is None else self._keys.find(shown)
        if shown is None or key is None:
            if self._are_keys_wanted():
                raise _bad_key() if shown else _no_key()
            refuse_foreign(scope)
            return ANYBODY
        self._wanted = True
        self._seen[key.id] = key
        wait_s = self._allowance.seconds_to_wait(key)
        if wait_s > 0:
            raise _too_many_requests(key, wait_s)
        needed = Role.VIEWER if scope["method"] in _READING else Role.SUBMITTER
        if not key.role.includes(needed):
            raise _role_too_low(key, needed)
        caller = Caller(key, partial(self._still_opens, shown))
        self._check_job(scope, caller)
        return caller

    def _still_opens(self, shown: str) -> bool:
        """Whether a key that opened the API does so still; it does while Redis is away."""
        try:
            return self._keys.find(shown) is not None
        except StoreUnavailable:
            return True

    def _are_keys_wanted(self) -> bool:
        # Redis is asked in any case: while it is away, nobody is told that a key is what is wrong.
        self._wanted = self._keys.any_made() or self._access is Access.KEYS
        return self._wanted

    def _check_job(self, scope: Scope, caller: Caller) -> None:
        """Raise where the request would change a job that is not the caller's."""
        job = _JOB.match(scope["path"])
        if job is None or scope["method"] in _READING or caller.may_steer(None):
            return
        owner = self._keys.owner_of(job[1])
        if owner is not None:  # there is such a job
            caller.check_may_steer(job[1], owner)

    def _is_remembered(self, scope: Scope) -> bool:
        """Whether the request would have been let through when Redis last answered."""
        if not self._wanted:
            refuse_foreign(scope)
            return True
        shown = _shown_key(scope) or ""
        return any(opens(key, shown) for key in tuple(self._seen.values()))


def needs_key(path: str) -> bool:
    """Whether what is served at the path is the farm's, and not the same for everybody."""
    return (path.startswith("/v1/") and path != _RULES) or path == _METRICS


def _shown_key(scope: Scope) -> str | None:
    match = _BEARER.fullmatch((header(scope["headers"], b"authorization") or "").strip())
    return None if match is None else match[1]


def _no_key() -> Problem:
    return Problem(
        problems.NO_KEY,
        "this service needs an API key, in the header Authorization: Bearer KEY; plateau's "
        "commands take it from PLATEAU_KEY or PLATEAU_KEY_FILE, its Python client as "
        "Client(key=…), and `plateau keys create NAME`, where the service runs, makes one",
        headers={"WWW-Authenticate": 'Bearer realm="plateau"'},
    )


def _bad_key() -> Problem:
    return Problem(
        problems.BAD_KEY,
        "the service does not know this key, or it was revoked; check PLATEAU_KEY, or ask who "
        "runs the service for another: `plateau keys create NAME` makes one",
        headers={"WWW-Authenticate": 'Bearer realm="plateau", error="invalid_token"'},
    )


def _role_too_low(key: ApiKey, needed: Role) -> Problem:
    return Problem(
        problems.ROLE_TOO_LOW,
        f"this needs a key with the role {needed.value}, and the key {key.name!r} has the role "
        f"{key.role.value}; "
        f"`plateau keys create NAME --role {needed.value}` makes one",
        headers={"WWW-Authenticate": 'Bearer realm="plateau", error="insufficient_scope"'},
        role=key.role.value,
        needed=needed.value,
    )


def _too_many_requests(key: ApiKey, wait_s: float) -> Problem:
    rate, burst = key.limits.requests_per_minute, key.limits.burst
    seconds = max(1, math.ceil(wait_s))
    return Problem(
        problems.TOO_MANY_REQUESTS,
        f"the key {key.name!r} may make {rate:g} requests a minute, and {burst:,} at once; "
        f"try again in {seconds} s",
        headers={"Retry-After": str(seconds)},
    )
