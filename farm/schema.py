"""What every process checks at its start: the layout in Redis, and that the blobs belong to it."""

import logging
import random
import threading
from importlib.resources import files
from typing import Any, Final

import redis

from farm import keys
from farm.blobs import Blobs
from farm.errors import SchemaMismatch, StoreUnavailable
from farm.pairing import check_pair
from farm.redis_link import unavailable_as_farm_error

_LOG = logging.getLogger(__name__)

_RETRY_S: Final = 1.0

#: What keeps the index of the jobs that wait for a worker.
_INDEX: Final = (files("farm") / "lua" / "waiting.lua").read_text()

#: The layout that this Plateau reads and writes.
VERSION: Final = 4

#: From each older layout that can be brought forward, the Lua that turns it into the next. It must
#: not fail half-way: Redis undoes nothing.
_MIGRATIONS: Final = {
    # Layout 1 had no version. Its jobs had one set of results, straight under jobs/ID; and their
    # checkpoints were noted without a SHA-256: without one, their slices are rendered again.
    1: """
      for _, id in ipairs(redis.call('ZRANGE', JOBS, 0, -1)) do
        redis.call('HSETNX', job_key(id), 'results', 'jobs/' .. id)
        redis.call('HDEL', job_key(id), 'checkpoint')
      end
    """,
    # Layout 2 had no index of the jobs of a batch, nor of those in a state.
    2: """
      local jobs = redis.call('ZRANGE', JOBS, 0, -1, 'WITHSCORES')
      for i = 1, #jobs, 2 do
        local id, number = jobs[i], jobs[i + 1]
        local job = redis.call('HMGET', job_key(id), 'state', 'batch')
        if job[1] then
          redis.call('HSETNX', job_key(id), 'number', number)
          redis.call('ZADD', in_state_key(job[1]), number, id)
        end
        if job[2] and job[2] ~= '' then
          redis.call('ZADD', batch_key(job[2]), number, id)
          redis.call('ZADD', BATCHES, number, job[2])
        end
      end
    """,
    # Layout 3 had no index of what waits and what is leased: a lease read every open job. And all
    # planned slices were in the stream.
    3: """
      local time = redis.call('TIME')
      local now_ms = time[1] * 1000 + time[2] / 1000
      for _, id in ipairs(redis.call('ZRANGE', OPEN, 0, -1)) do
        local slices, leased = job_key(id, 'slices'), {}
        if redis.call('EXISTS', slices) == 1 then
          leased = redis.call('XPENDING', slices, GROUP, '-', '+', 1000000)
        end
        for _, lease in ipairs(leased) do
          local entry, worker, idle_ms = lease[1], lease[2], lease[3]
          local found = redis.call('XRANGE', slices, entry, entry)[1]
          if found and worker == 'nobody' then
            redis.call('ZADD', job_key(id, 'lost'), found[2][2], entry)
          else
            redis.call('ZADD', LEASES, now_ms - idle_ms, id .. ' ' .. entry)
          end
        end
        local planned = redis.call('HGET', job_key(id), 'planned') or 0
        redis.call('HSET', job_key(id), 'leased', #leased, 'issued', planned)
        changed[id] = true
      end
    """,
}

_CHECK: Final = """
-- Bring the layout to the version that is wanted, where the migrations lead there.
-- ARGV: the version wanted.
-- Returns the version that the data then has: another than the wanted one is left as it was found.
local wanted = tonumber(ARGV[1])
local version = redis.call('GET', SCHEMA)
if not version then
  local used = redis.call('EXISTS', JOBS, SCENES) > 0
  version = used and '1' or ARGV[1]
end
local path, from = {}, tonumber(version)
while from and from < wanted and MIGRATIONS[from] do
  table.insert(path, MIGRATIONS[from])
  from = from + 1
end
if from ~= wanted then return version end
for _, migrate in ipairs(path) do migrate() end
file_changed()
redis.call('SET', SCHEMA, ARGV[1])
return ARGV[1]
"""


def check_schema(client: redis.Redis) -> None:
    """Return once Redis holds this Plateau's layout: its own, none yet, or an older one migrated.

    Any number of processes may call it at once: it is one atomic script.

    Raises
    ------
    SchemaMismatch
        The layout is newer, or too old to be migrated; nothing was changed.
    StoreUnavailable
        Redis is away.
    """
    with unavailable_as_farm_error():
        found = client.eval(_script(_MIGRATIONS), 0, VERSION)
    if found != str(VERSION):
        raise SchemaMismatch(_refusal(found))


def await_checks(client: redis.Redis, store: Blobs, stop: threading.Event) -> None:
    """As `check_schema` and `check_pair`, once all answer; unchecked where `stop` is set before."""
    while not stop.is_set():
        try:
            check_schema(client)
            check_pair(client, store)
        except StoreUnavailable as error:
            _LOG.warning("%s; trying again", error)
            stop.wait(_RETRY_S * random.uniform(0.5, 1.5))
        else:
            return


def _script(migrations: dict[int, str]) -> str:
    functions = (f"[{version}] = function() {lua} end" for version, lua in migrations.items())
    return (
        f"{keys.LUA}\n{_INDEX}\nlocal SCHEMA = '{keys.SCHEMA}'\n"
        f"local MIGRATIONS = {{{', '.join(functions)}}}\n{_CHECK}"
    )


def _refusal(found: Any) -> str:
    known = f"this Plateau works with layout {VERSION}"
    if not str(found).isdigit():
        return (
            f"{keys.SCHEMA} in Redis is {found!r}, which is no version of Plateau's data: "
            "point PLATEAU_REDIS_URL or PLATEAU_DATA at a Redis or a folder of Plateau's own"
        )
    if int(found) > VERSION:
        return (
            f"the data in Redis has layout {found}, and {known}: it was written by a newer "
            "Plateau; install that version here, or choose another PLATEAU_DATA or "
            "PLATEAU_REDIS_URL; nothing was changed"
        )
    return (
        f"the data in Redis has layout {found}, and {known} and cannot bring this one forward: "
        "start a version between the two on it first, or choose another PLATEAU_DATA or "
        "PLATEAU_REDIS_URL; nothing was changed"
    )
