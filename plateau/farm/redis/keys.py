"""Every Redis key of Plateau, built here and nowhere else; extensions have keys of their own.

========================= ======= ==================================================== =========
key                       type    what                                                 lifetime
========================= ======= ==================================================== =========
plateau:schema            string  version of this layout, see `ledger.schema`           for ever
plateau:store             hash    ``id`` that the blob store has, too, and whether they   for ever
                                  are ``paired``: `ledger.pairing`; jobs ``created``;
                                  ``next_sweep_at`` (ms)
plateau:jobs              zset    job id, scored by its number of creation             the job's
plateau:jobs:open         zset    jobs that have not ended, scored by priority         till end
plateau:jobs:unfinished   set     jobs that still need a monitor                       till done
plateau:waiting           zset    queues, "PRIORITY CLASS", in which a job waits for   their jobs'
                                  a worker, scored by priority; see waiting.lua
plateau:waiting:Q         zset    each owner's next job in queue Q                     its jobs'
plateau:waiting:Q:ID      zset    each batch's, and each single job, of key ID or ""   its jobs'
plateau:waiting:Q:ID:NAME zset    the jobs of a batch that wait, scored by number      its jobs'
plateau:needs             hash    pool and tags of open jobs → how many jobs           the jobs'
plateau:late              zset    "ID CLASS" of jobs, scored by when the slice that     till then
                                  holds up their image is late (ms)
plateau:idle              hash    idle workers → 1                                      while so
plateau:idle:kinds        set     their kinds, and maybe others                        till woken
plateau:idle:KIND         set     those of the kind, and maybe others                  till woken
plateau:share:ID          hash    of key ID or "": priority → spp leased, queue → the  till none
                                  entry of its next job there
plateau:share:ID:NAME     hash    the same of a batch                                  till none
plateau:leases            zset    "ID ENTRY" of each lease, scored by its renewal (ms)  the lease's
plateau:jobs:in:STATE     zset    jobs in this state, scored as in plateau:jobs        the jobs'
plateau:jobs:deleted      zset    deleted jobs, which are in no batch, scored so       till restored
plateau:batches           zset    batch name, scored by the number of its newest job   its jobs'
plateau:batch:NAME        zset    the batch's jobs, scored as in plateau:jobs          its jobs'
plateau:jobs:awaiting     set     jobs that wait until others have ended; see            while so
                                  after.lua
plateau:scenes            hash    scene SHA-256 → JSON summary                         the scene's
plateau:scenes:used       zset    scene SHA-256, scored by its last use (ms)           the scene's
plateau:scene:SHA:going   string  set while the scene's blob is being removed          5 min
plateau:workers           zset    worker id, scored by last heartbeat (ms)             1 h
plateau:worker:ID         hash    its description; ``drained`` where it is, ``blamed``   1 h
                                  for slices with which it was lost, ``left_out`` of jobs
plateau:monitors          zset    monitor id, scored by when its heartbeat is overdue  1 h
plateau:monitor:ID        hash    the number of its ``jobs``                           1 h
plateau:totals            hash    counters of the whole farm; see `ledger.totals`      for ever
plateau:heard             hash    ``at``: time of the last heartbeat of any worker (ms);  for ever
                                  ``spared_till``: until when no lease is taken from it
plateau:told:BLOB         string  set when a worker was told that its partial is unused  1 h
plateau:keys              hash    key id → JSON of an API key; see `ledger.api_keys`     for ever
plateau:keys:used         hash    key id → when it was last used (ms), to a minute     for ever
plateau:key:ID:open       set     the key's jobs that have not ended                   till they do
plateau:key:ID:jobs       zset    the key's jobs, scored by their number of creation   the jobs'
plateau:notices           zset    receivers of notices, scored by when one is due (ms)  till told
plateau:notices:RECEIVER  zset    jobs whose notice waits for it (a target's name, or   till told
                                  a URL without its path), scored by when it is due
plateau:troubles          hash    "SCOPE TARGET TROUBLE" → since when (ms), and until    while so
                                  when it is being told (ms), or ``told``
plateau:idempotency:KEY   string  JSON of job id and request digest                    24 h
plateau:job:ID            hash    the job; see `ledger.jobs`                           the job's
plateau:job:ID:slices     stream  slices that were leased; group `workers` holds them  till end
plateau:job:ID:lost       zset    leased entries without a worker, scored by slice     till end
plateau:job:ID:leases     hash    slice index → since when it is leased (ms), the       till end
                                  pace of its worker, the entry, and a second try's
plateau:job:ID:paces      hash    worker → ms for which it had its last slice, until    till end
                                  its commit or that of another try
plateau:job:ID:outrun     hash    entry whose slice another try committed → the worker  till end
                                  of that try; till its own worker reports
plateau:job:ID:ledger     hash    slice index → JSON of its commit                     the job's
plateau:job:ID:after      zset    gates that it waits for, in the order of its spec    till open
plateau:job:ID:rounds     zset    JSON of each round that an image has decided, by     the job's
                                  zones; scored by the index of its first slice
plateau:job:ID:seeds      zset    "first-last" of each commit, scored by first         till done
plateau:job:ID:deaths     hash    slice index → JSON list of the causes; "INDEX forgiven",  till end
                                  "INDEX spoiled" → how often it was, or its partial lost
plateau:job:ID:curve      stream  points; the entry's id is spp-0                      the job's
plateau:job:ID:events     stream  state, image, point, slice, trouble, finished        the job's
plateau:job:ID:log        stream  how tries of slices ended, and their output, ~2000   the job's
plateau:job:ID:sealed     hash    fields that workers cannot change: the job's API key,  the job's
                                  ``owner`` and ``owner_name``; ``deleted_at`` (ms);
                                  ``fence``, the fencing tokens given out;
                                  ``receivers`` of its notices, ``notice_url``,
                                  ``notice_secret``, "notice RECEIVER" → JSON of how it
                                  stands; ``whole_batch`` (JSON) if its batch's last
plateau:job:ID:digests    hash    blob, without jobs/ID/ → SHA-256 of its bytes: of     the job's
                                  shown results and of previews
plateau:job:ID:shot       hash    of a shot's first frame: ``frames`` (JSON of ids), the  the job's
                                  number of ``looks``, ``look:0`` … (JSON), ``why``;
                                  ``over`` once it was the last
plateau:job:ID:owner      string  fencing token of the monitor that owns the job       15 s
========================= ======= ==================================================== =========

Channels carry only hints (a process that misses one looks again within some seconds):
``plateau:wake:workers`` (``ended ID``, and ``ended ID ENTRY`` where another try was first),
``plateau:wake:workers:ID`` (``planned``, to an idle one),
``plateau:wake:monitors`` (``free ID``, or a job id) and ``plateau:wake:notifier`` (a job id).

The script in ``plateau/farm/redis/lua`` writes all keys but the layout's version, which
`plateau.farm.ledger.schema` writes.
"""

from typing import Final

from plateau.farm.model.place_names import DEFAULT_POOL

PREFIX: Final = "plateau:"
SCHEMA: Final = PREFIX + "schema"
STORE: Final = PREFIX + "store"
JOBS: Final = PREFIX + "jobs"
OPEN: Final = PREFIX + "jobs:open"
UNFINISHED: Final = PREFIX + "jobs:unfinished"
WAITING: Final = PREFIX + "waiting"
LEASES: Final = PREFIX + "leases"
NEEDS: Final = PREFIX + "needs"
TROUBLES: Final = PREFIX + "troubles"
LATE: Final = PREFIX + "late"
IDLE: Final = PREFIX + "idle"
DELETED: Final = PREFIX + "jobs:deleted"
BATCHES: Final = PREFIX + "batches"
AWAITING: Final = PREFIX + "jobs:awaiting"
SCENES: Final = PREFIX + "scenes"
SCENES_USED: Final = PREFIX + "scenes:used"
WORKERS: Final = PREFIX + "workers"
MONITORS: Final = PREFIX + "monitors"
TOTALS: Final = PREFIX + "totals"
HEARD: Final = PREFIX + "heard"
API_KEYS: Final = PREFIX + "keys"
API_KEYS_USED: Final = PREFIX + "keys:used"
NOTICES: Final = PREFIX + "notices"
WAKE_WORKERS: Final = PREFIX + "wake:workers"
WAKE_MONITORS: Final = PREFIX + "wake:monitors"
#: Before the id in a hint to monitors: the job's owner has given it back.
FREE: Final = "free "
WAKE_NOTIFIER: Final = PREFIX + "wake:notifier"

#: Most different needs (pool and tags) of open jobs: a lease may look at each.
MOST_NEEDS: Final = 64

#: The consumer group of every job's slices.
GROUP: Final = "workers"

#: The keys of a job besides its hash.
JOB_PARTS: Final = (
    *("slices", "lost", "leases", "paces", "outrun", "ledger", "seeds", "deaths"),
    *("curve", "events", "log", "sealed", "digests"),
    *("owner", "rounds", "after", "shot"),
)


def job(job_id: str, part: str = "") -> str:
    """The key of a job, or of one of its parts (``ledger``, ``curve``, …)."""
    return f"{PREFIX}job:{job_id}:{part}" if part else f"{PREFIX}job:{job_id}"


def in_state(state: str) -> str:
    """The key of the index of the jobs in a state."""
    return f"{PREFIX}jobs:in:{state}"


def batch(name: str) -> str:
    """The key of the index of a batch's jobs; no name makes it another key."""
    return f"{PREFIX}batch:{name}"


def jobs_of_key(key_id: str) -> str:
    """The key of the index of an API key's jobs."""
    return f"{PREFIX}key:{key_id}:jobs"


def worker(worker_id: str) -> str:
    """The key of a worker's description."""
    return f"{PREFIX}worker:{worker_id}"


def monitor(monitor_id: str) -> str:
    """The key of a monitor's description."""
    return f"{PREFIX}monitor:{monitor_id}"


def wake_worker(worker_id: str) -> str:
    """The channel that wakes one idle worker."""
    return f"{WAKE_WORKERS}:{worker_id}"


def scene_going(sha256: str) -> str:
    """The key of the mark that the scene's blob is being removed."""
    return f"{PREFIX}scene:{sha256}:going"


#: The names for the script, which builds keys itself. (So Plateau needs a Redis with one keyspace:
#: standalone, Sentinel or managed; not a cluster.)
LUA: Final = f"""
local PREFIX, GROUP = '{PREFIX}', '{GROUP}'
local JOBS, UNFINISHED, OPEN, DELETED = '{JOBS}', '{UNFINISHED}', '{OPEN}', '{DELETED}'
local WAITING, LEASES, LATE, FREE = '{WAITING}', '{LEASES}', '{LATE}', '{FREE}'
local NEEDS, IDLE, IDLE_KINDS = '{NEEDS}', '{IDLE}', '{IDLE}:kinds'
local DEFAULT_POOL, MOST_NEEDS = '{DEFAULT_POOL}', {MOST_NEEDS}
local function wake_worker_key(id) return '{WAKE_WORKERS}:' .. id end
local JOB_PARTS = {{'{"', '".join(JOB_PARTS)}'}}
local SCENES, SCENES_USED, WORKERS = '{SCENES}', '{SCENES_USED}', '{WORKERS}'
local MONITORS, TOTALS, TROUBLES = '{MONITORS}', '{TOTALS}', '{TROUBLES}'
local SCHEMA, STORE, HEARD = '{SCHEMA}', '{STORE}', '{HEARD}'
local API_KEYS, API_KEYS_USED = '{API_KEYS}', '{API_KEYS_USED}'
local WAKE_WORKERS, WAKE_MONITORS = '{WAKE_WORKERS}', '{WAKE_MONITORS}'
local NOTICES, WAKE_NOTIFIER = '{NOTICES}', '{WAKE_NOTIFIER}'
local function job_key(id, part) return PREFIX .. 'job:' .. id .. (part and ':' .. part or '') end
local BATCHES, AWAITING = '{BATCHES}', '{AWAITING}'
local function in_state_key(state) return PREFIX .. 'jobs:in:' .. state end
local function batch_key(name) return PREFIX .. 'batch:' .. name end
local function told_key(blob) return PREFIX .. 'told:' .. blob end
local function worker_key(id) return PREFIX .. 'worker:' .. id end
local function api_key_key(id, part) return PREFIX .. 'key:' .. id .. ':' .. part end
local function monitor_key(id) return PREFIX .. 'monitor:' .. id end
local function scene_going_key(sha256) return PREFIX .. 'scene:' .. sha256 .. ':going' end
"""
