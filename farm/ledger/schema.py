"""What every process checks at its start: the layout in Redis, and that the blobs belong to it."""

import logging
import math
import random
import threading
import time
from typing import Any, Final

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.pairing import check_pair
from plateau.farm.ledger.workers import ALIVE_S
from plateau.farm.model import versions
from plateau.farm.model.errors import (
    Incompatible,
    NotPermitted,
    OldProcesses,
    SchemaMismatch,
    StoreUnavailable,
    needs_other_layout,
)
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.link import unavailable_as_farm_error
from plateau.farm.redis.scripts import library

_LOG = logging.getLogger(__name__)

_RETRY_S: Final = 1.0
#: Who was killed is taken for alive for so long at most, and so is waited for.
_FADE_S: Final = ALIVE_S + 5.0
#: Between two lines about what is waited for.
_SAY_AGAIN_S: Final = 60.0

#: From each older layout that can be brought forward, the Lua that turns it into the next. It must
#: not fail half-way: Redis undoes nothing.
_MIGRATIONS: Final[dict[int, str]] = {}

_CHECK: Final = """
-- Bring the layout to the version that is wanted, where the migrations lead there and nobody works
-- with it as it is.
-- ARGV: the version wanted, ms after which a worker that was not heard of is gone
-- Returns the version that the data then has, where another than the wanted one is left as it was
-- found, and who lives for whom it was left.
local wanted = tonumber(ARGV[1])

local function who_lives()
  local time, found = redis.call('TIME'), {}
  local now_ms = time[1] * 1000 + time[2] / 1000
  for _, members in ipairs({{'worker', WORKERS, now_ms - ARGV[2]}, {'monitor', MONITORS, now_ms},
                            {'API', APIS, now_ms}}) do
    for _, id in ipairs(redis.call('ZRANGEBYSCORE', members[2], members[3], '+inf')) do
      found[#found + 1] = members[1] .. ' ' .. id
    end
  end
  return found
end
local version = redis.call('GET', SCHEMA) or ARGV[1]
local path, from = {}, tonumber(version)
while from and from < wanted and MIGRATIONS[from] do
  table.insert(path, MIGRATIONS[from])
  from = from + 1
end
if from ~= wanted then return {version} end
local others = #path > 0 and who_lives() or {}
if #others > 0 then return {version, unpack(others)} end
for _, migrate in ipairs(path) do migrate() end
Waiting.file_changed()
redis.call('SET', SCHEMA, ARGV[1])
return {ARGV[1]}
"""


def check_schema(client: RedisClient) -> None:
    """Return once Redis holds this Plateau's layout: its own, none yet, or an older one migrated.

    Any number of processes may call it at once: it is one atomic script.

    Raises
    ------
    SchemaMismatch
        The layout is newer, or too old to be migrated; nothing was changed.
    OldProcesses
        It is older, and processes live that work with it.
    StoreUnavailable
        Redis is away.
    """
    with unavailable_as_farm_error():
        found, who = client.get(keys.SCHEMA), []
        if found != str(versions.LAYOUT):
            try:
                found, *who = _brought_forward(client)
            except NotPermitted:
                if found is None or (found.isdigit() and int(found) < versions.LAYOUT):
                    raise StoreUnavailable(_wait_for_others(found)) from None
    if who:
        raise OldProcesses(found, tuple(who))
    if found != str(versions.LAYOUT):
        raise SchemaMismatch(_refusal(found))


def _brought_forward(client: RedisClient) -> list[str]:
    """What the script answers that brings the layout to this version where it can."""
    with unavailable_as_farm_error():
        life_ms = round(ALIVE_S * 1000)
        answer: list[str] = client.eval(_script(_MIGRATIONS), 0, versions.LAYOUT, life_ms)
    return answer


def await_schema(client: RedisClient, stop: threading.Event, *, patient: bool = False) -> None:
    """As `check_schema`, but wait for who may just have stopped; unchecked where `stop` is set.

    Who was killed is taken for alive for a while, so `OldProcesses` is raised only where some are
    left after that. With `patient`, whatever makes this Plateau `Incompatible` is waited
    for until it changes.
    """
    waits = _Waits(patient=patient)
    while not stop.is_set():
        try:
            check_schema(client)
        except Incompatible as error:
            waits.before_next(error, stop)
        else:
            return


def await_checks(
    client: RedisClient, store: Blobs, stop: threading.Event, *, patient: bool = False
) -> None:
    """As `await_schema` and `check_pair`, once all answer; unchecked where `stop` is set before."""
    while not stop.is_set():
        try:
            await_schema(client, stop, patient=patient)
            if not stop.is_set():
                check_pair(client, store)
        except StoreUnavailable as error:
            _LOG.warning("%s; trying again", error)
            stop.wait(_RETRY_S * random.uniform(0.5, 1.5))
        else:
            return


class _Waits:
    """Waits between two looks at a layout that does not suit, for as long as there is hope."""

    def __init__(self, *, patient: bool) -> None:
        self._patient = patient
        self._until = time.monotonic() + _FADE_S
        self._said_at = -math.inf

    def before_next(self, error: Incompatible, stop: threading.Event) -> None:
        """Wait before the next look, or raise the error where there should be none."""
        now = time.monotonic()
        fades = isinstance(error, OldProcesses) and now < self._until
        if not (self._patient or fades):
            raise error
        if now > self._said_at + _SAY_AGAIN_S:
            _LOG.warning("%s; waiting", error)
            self._said_at = now
        stop.wait(_RETRY_S * random.uniform(0.5, 1.5))


def _script(migrations: dict[int, str]) -> str:
    functions = (f"[{version}] = function() {lua} end" for version, lua in migrations.items())
    return f"{library()}\nlocal MIGRATIONS = {{{', '.join(functions)}}}\n{_CHECK}"


def _wait_for_others(found: str | None) -> str:
    if found is None:
        return (
            "Redis has no data of Plateau's yet, and this process may not set it up; start a "
            "monitor or an API, which does"
        )
    return (
        f"{needs_other_layout(found)}. This process may not migrate it; start a monitor or an API, "
        "which does"
    )


def _refusal(found: Any) -> str:
    if not str(found).isdigit():
        return (
            f"the key {keys.SCHEMA} in Redis says {found!r}, which is no layout of Plateau's; set "
            "PLATEAU_REDIS_URL or PLATEAU_DATA to a Redis or a folder that is Plateau's alone"
        )
    if int(found) > versions.LAYOUT:
        return (
            f"{needs_other_layout(found)}: a newer Plateau wrote it; install that version here, or "
            "choose another PLATEAU_DATA or PLATEAU_REDIS_URL. Nothing was changed"
        )
    return (
        f"{needs_other_layout(found)} and cannot migrate data that old; start a Plateau of a "
        "version between the two first, or choose another PLATEAU_DATA or PLATEAU_REDIS_URL. "
        "Nothing was changed"
    )
