"""Every Redis key of Plateau, built here and nowhere else.

========================= ======= ==================================================== =========
key                       type    what                                                 lifetime
========================= ======= ==================================================== =========
plateau:schema            string  version of this layout                               for ever
plateau:created           string  counter: jobs created so far                         for ever
plateau:jobs              zset    job id, scored by its number of creation             the job's
plateau:jobs:open         zset    queued and rendering jobs, scored by priority        till end
plateau:jobs:unfinished   set     jobs that a monitor still has work with              till done
plateau:scenes            hash    scene SHA-256 → JSON summary                         for ever
plateau:workers           zset    worker id, scored by last heartbeat (ms)             1 h
plateau:worker:ID         hash    the worker's description                             1 h
plateau:idempotency:KEY   string  JSON of job id and request digest                    24 h
plateau:job:ID            hash    the job; see `farm.store`                            the job's
plateau:job:ID:slices     stream  planned slices; group `workers` holds the leases     till end
plateau:job:ID:ledger     hash    slice index → JSON of its commit                     the job's
plateau:job:ID:seeds      zset    "first-last" of each commit, scored by first         the job's
plateau:job:ID:deaths     hash    slice index → JSON list of the causes                till end
plateau:job:ID:curve      stream  points; the entry's id is spp-0                      the job's
plateau:job:ID:events     stream  state, point, slice, finished                        the job's
plateau:job:ID:owner      string  fencing token of the monitor that owns the job       15 s
plateau:job:ID:fence      string  counter: fencing tokens given out                    the job's
========================= ======= ==================================================== =========

Channels, hints only (who misses one looks again within a second):
``plateau:wake:workers`` (``planned``, or ``ended ID``), ``plateau:wake:monitors`` (a job id).

Writers: everything is written by the scripts in ``farm/lua``.
"""

from typing import Final

PREFIX: Final = "plateau:"
SCHEMA: Final = PREFIX + "schema"
JOBS: Final = PREFIX + "jobs"
OPEN: Final = PREFIX + "jobs:open"
UNFINISHED: Final = PREFIX + "jobs:unfinished"
SCENES: Final = PREFIX + "scenes"
WORKERS: Final = PREFIX + "workers"
WAKE_WORKERS: Final = PREFIX + "wake:workers"
WAKE_MONITORS: Final = PREFIX + "wake:monitors"

#: The consumer group of every job's slices.
GROUP: Final = "workers"


def job(job_id: str, part: str = "") -> str:
    """The key of a job, or of one of its parts (``ledger``, ``curve``, …)."""
    return f"{PREFIX}job:{job_id}:{part}" if part else f"{PREFIX}job:{job_id}"


def worker(worker_id: str) -> str:
    """The key of a worker's description."""
    return f"{PREFIX}worker:{worker_id}"


#: The same names for the scripts, which find jobs by themselves. (So Plateau needs one Redis
#: with one keyspace: standalone, Sentinel or managed; not a cluster.)
LUA: Final = f"""
local PREFIX, GROUP = '{PREFIX}', '{GROUP}'
local JOBS, UNFINISHED, OPEN = '{JOBS}', '{UNFINISHED}', '{OPEN}'
local SCENES, WORKERS = '{SCENES}', '{WORKERS}'
local WAKE_WORKERS, WAKE_MONITORS = '{WAKE_WORKERS}', '{WAKE_MONITORS}'
local function job_key(id, part)
  if part then return PREFIX .. 'job:' .. id .. ':' .. part end
  return PREFIX .. 'job:' .. id
end
local function worker_key(id) return PREFIX .. 'worker:' .. id end
"""
