"""The checks of every process at its start: Redis's layout, and its pairing with the blobs."""

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
#: A killed process counts as alive for at most this long.
_FADE_S: Final = ALIVE_S + 5.0
#: Between two log lines about the wait.
_SAY_AGAIN_S: Final = 60.0

#: By older layout, the Lua that migrates it to the next. It must not fail half-way: Redis has no
#: rollback.
_MIGRATIONS: Final[dict[int, str]] = {}

_CHECK: Final = """
-- Migrate the layout to the wanted version, if the migrations lead there and no process that works
-- with the present layout lives.
-- ARGV: the wanted version, ms without a heartbeat after which a worker is dead
-- Returns the version of the data, and the living processes that prevented a migration.
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
    """Return once Redis has this Plateau's layout: an older one is migrated, an empty Redis set up.

    Any number of processes may call it at once: it is one atomic script.

    Raises
    ------
    SchemaMismatch
        The layout is newer, or too old to be migrated; nothing was changed.
    OldProcesses
        The layout is older, and processes that work with it live.
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
    """Run the script that migrates the layout, and return its answer."""
    with unavailable_as_farm_error():
        life_ms = round(ALIVE_S * 1000)
        answer: list[str] = client.eval(_script(_MIGRATIONS), 0, versions.LAYOUT, life_ms)
    return answer


def await_schema(client: RedisClient, stop: threading.Event, *, patient: bool = False) -> None:
    """As `check_schema`, but with a wait; unchecked where `stop` is set.

    Killed processes count as alive for a while: `OldProcesses` is raised only if some are left
    after that. With `patient`, this waits as long as Plateau is `Incompatible`.
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
    """As `await_schema` and `check_pair`, with a wait for both stores; unchecked at `stop`."""
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
    """Waits between two checks of a wrong layout, as long as it may change."""

    def __init__(self, *, patient: bool) -> None:
        self._patient = patient
        self._until = time.monotonic() + _FADE_S
        self._said_at = -math.inf

    def before_next(self, error: Incompatible, stop: threading.Event) -> None:
        """Wait before the next check, or raise the error if waiting is of no use."""
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
