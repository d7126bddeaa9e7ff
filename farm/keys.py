"""Every Redis key of Plateau, built here and nowhere else.

========================= ======= ==================================================== =========
key                       type    what                                                 lifetime
========================= ======= ==================================================== =========
plateau:schema            string  version of this layout, written by `farm.schema`      for ever
plateau:store             hash    id that the blob store has too; `farm.pairing`         for ever
plateau:created           string  counter: jobs created so far                         for ever
plateau:jobs              zset    job id, scored by its number of creation             the job's
plateau:jobs:open         zset    jobs that have not ended, scored by priority         till end
plateau:jobs:unfinished   set     jobs that a monitor still has work with              till done
plateau:scenes            hash    scene SHA-256 → JSON summary                         the scene's
plateau:scenes:used       zset    scene SHA-256, scored by its last use (ms)           the scene's
plateau:scene:SHA:going   string  set while the scene's blob is being removed          5 min
plateau:swept             string  set by the monitor that sweeps: no other need to     1 h
plateau:workers           zset    worker id, scored by last heartbeat (ms)             1 h
plateau:worker:ID         hash    the worker's description                             1 h
plateau:monitors          zset    monitor id, scored by when its heartbeat is overdue  1 h
plateau:monitor:ID        hash    the monitor's description, and what of its work is   1 d
                                  in the totals
plateau:totals            hash    counters of the whole farm; see `farm.totals`        for ever
plateau:heard             string  when any worker's heartbeat came last (ms)           for ever
plateau:grace             string  set while no lease is taken from its worker          a lease
plateau:idempotency:KEY   string  JSON of job id and request digest                    24 h
plateau:job:ID            hash    the job; see `farm.jobs`                             the job's
plateau:job:ID:slices     stream  planned slices; group `workers` holds the leases     till end
plateau:job:ID:ledger     hash    slice index → JSON of its commit                     the job's
plateau:job:ID:seeds      zset    "first-last" of each commit, scored by first         till done
plateau:job:ID:deaths     hash    slice index → JSON list of the causes                till end
plateau:job:ID:spoiled    hash    slice index → how often its partial was lost         till end
plateau:job:ID:curve      stream  points; the entry's id is spp-0                      the job's
plateau:job:ID:events     stream  state, point, slice, trouble, finished               the job's
plateau:job:ID:log        stream  how tries of slices ended and what was printed, ~2000  the job's
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
STORE: Final = PREFIX + "store"
JOBS: Final = PREFIX + "jobs"
OPEN: Final = PREFIX + "jobs:open"
UNFINISHED: Final = PREFIX + "jobs:unfinished"
SCENES: Final = PREFIX + "scenes"
SCENES_USED: Final = PREFIX + "scenes:used"
SWEPT: Final = PREFIX + "swept"
WORKERS: Final = PREFIX + "workers"
MONITORS: Final = PREFIX + "monitors"
TOTALS: Final = PREFIX + "totals"
HEARD: Final = PREFIX + "heard"
GRACE: Final = PREFIX + "grace"
WAKE_WORKERS: Final = PREFIX + "wake:workers"
WAKE_MONITORS: Final = PREFIX + "wake:monitors"

#: The consumer group of every job's slices.
GROUP: Final = "workers"

#: The keys of a job beside its hash.
JOB_PARTS: Final = (
    "slices",
    "ledger",
    "seeds",
    "deaths",
    "spoiled",
    "curve",
    "events",
    "log",
    "owner",
    "fence",
)


def job(job_id: str, part: str = "") -> str:
    """The key of a job, or of one of its parts (``ledger``, ``curve``, …)."""
    return f"{PREFIX}job:{job_id}:{part}" if part else f"{PREFIX}job:{job_id}"


def worker(worker_id: str) -> str:
    """The key of a worker's description."""
    return f"{PREFIX}worker:{worker_id}"


def scene_going(sha256: str) -> str:
    """The key that says that the scene's blob is being removed."""
    return f"{PREFIX}scene:{sha256}:going"


#: The same names for the scripts, which find jobs by themselves. (So Plateau needs one Redis
#: with one keyspace: standalone, Sentinel or managed; not a cluster.)
LUA: Final = f"""
local PREFIX, GROUP = '{PREFIX}', '{GROUP}'
local JOBS, UNFINISHED, OPEN = '{JOBS}', '{UNFINISHED}', '{OPEN}'
local JOB_PARTS = {{'{"', '".join(JOB_PARTS)}'}}
local SCENES, SCENES_USED, WORKERS = '{SCENES}', '{SCENES_USED}', '{WORKERS}'
local MONITORS, TOTALS = '{MONITORS}', '{TOTALS}'
local HEARD, GRACE = '{HEARD}', '{GRACE}'
local WAKE_WORKERS, WAKE_MONITORS = '{WAKE_WORKERS}', '{WAKE_MONITORS}'
local function job_key(id, part)
  if part then return PREFIX .. 'job:' .. id .. ':' .. part end
  return PREFIX .. 'job:' .. id
end
local function worker_key(id) return PREFIX .. 'worker:' .. id end
local function monitor_key(id) return PREFIX .. 'monitor:' .. id end
local function scene_going_key(sha256) return PREFIX .. 'scene:' .. sha256 .. ':going' end
"""
