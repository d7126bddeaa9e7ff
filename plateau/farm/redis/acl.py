"""The rights in Redis: a user for each kind of process, as rules for Redis's ACL file.

========================  ========================================================================
user                      may
========================  ========================================================================
``plateau-worker``        the queue: leases, ledgers, reports of slices and of the workers
``plateau-monitor``       that, and jobs, scenes, notices with their secrets, and the sweeps
``plateau-api``           that, and batches and the use of keys; read the keys themselves
``plateau-admin``         all of Plateau's data, for `plateau keys`, `gc` and `doctor`; and end a
                          script, a client or the server that hangs
``plateau-replica``       follow a master, for replicas of it
``plateau-sentinel``      watch servers and promote a replica
========================  ========================================================================

The script (`plateau.farm.redis.scripts`) runs with the rights of its caller's user. A worker can
run any script that a monitor, an API or the administrator has loaded, but within the keys, channels
and commands given here. Of Plateau's script it can run only the commands for workers: before any
other the script touches a key that is forbidden to workers. A worker can load no script: Redis runs
one at a time, and an endless one would stop the farm until the server is killed. Nor does a command
of Plateau's loop endlessly over a worker's data.

A hostile worker can still spoil the queue: it can write anything into a job's hash and ledger, and
so mark a job as failed or done, show a wrong image, forge what a notice says of a job, have a sweep
remove a job as old, or block other workers by unreadable entries; it can fill Redis's memory, and
keep Redis busy while it is connected. It sees the names of all keys, since a lease rebuilds a
damaged index. It cannot learn or change API keys, the secrets of notices, owners of jobs, which of
them are deleted, or the tokens of monitors, nor change whom a notice goes to. To shut it out, give
its user another password in the file; then ``plateau-admin`` may have Redis read it (`ACL LOAD`)
and end the connections (`CLIENT KILL USER plateau-worker`).

Redis has users since 6.0 and read-only rights (``%R~``) since 7.0: on 6.2 readers may write.
"""

import hashlib
import re
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Final

from plateau.extensions import extensions
from plateau.farm.redis import keys
from plateau.farm.redis.keys import PREFIX
from plateau.farm.redis.scripts import for_workers

#: Ids of jobs and keys have twelve digits; a star would match the parts of a job, too.
_ID: Final = "?" * 12

#: The parts of a job that are the queue.
QUEUE_PARTS: Final = (
    *("slices", "lost", "leases", "paces", "outrun", "ledger"),
    *("seeds", "deaths", "events", "log"),
)

_QUEUE: Final = (
    keys.job(_ID),
    *(keys.job(_ID, part) for part in QUEUE_PARTS),
    keys.OPEN,
    keys.in_state("*"),
    keys.WAITING,
    f"{keys.WAITING}:*",
    keys.NEEDS,
    keys.LATE,
    keys.LEASES,
    f"{PREFIX}share:*",
    keys.IDLE,
    f"{keys.IDLE}:*",
    keys.WORKERS,
    keys.worker("*"),
    keys.HEARD,
    keys.TOTALS,
    f"{PREFIX}told:*",
    # A job that fails leaves its key's open jobs.
    f"{PREFIX}key:{_ID}:open",
)
_READ_BY_WORKERS: Final = (
    *(keys.SCHEMA, keys.STORE),
    keys.job(_ID, "rounds"),
)

_MONITOR: Final = (
    *_QUEUE,
    *_READ_BY_WORKERS,
    *(keys.job(_ID, part) for part in keys.JOB_PARTS if part not in QUEUE_PARTS),
    keys.JOBS,
    keys.UNFINISHED,
    keys.DELETED,
    keys.BATCHES,
    keys.AWAITING,
    keys.batch("*"),
    keys.SCENES,
    keys.SCENES_USED,
    keys.scene_going("*"),
    keys.TROUBLES,
    keys.MONITORS,
    keys.monitor("*"),
    keys.jobs_of_key(_ID),
    keys.NOTICES,
    f"{keys.NOTICES}:*",
)
#: Beside those of a monitor.
_API: Final = (
    f"{PREFIX}idempotency:*",
    keys.API_KEYS_USED,
)
_READ_BY_API: Final = (keys.API_KEYS,)

#: The commands of a worker besides its scripts, to listen and to check schema and pairing.
_WORKER_COMMANDS: Final = (
    *("evalsha", "time", "get", "hmget", "zscore"),
    *("subscribe", "unsubscribe", "ping", "select", "acl|whoami"),
)
#: Without those that configure the server, list all its keys, or remove them all.
_DATA_COMMANDS: Final = ("+@all", "-@admin", "-@dangerous", "+info", "+acl|whoami")
#: With those that end a script, a client, or the server: a script that has written ends with it.
_ADMIN_COMMANDS: Final = (
    *_DATA_COMMANDS,
    *("+config|get", "+acl|log", "+acl|load", "+slowlog|get", "+client|list", "+client|kill"),
    *("+script|kill", "+shutdown"),
)
#: From Redis's documentation.
_REPLICA: Final = ("+psync", "+replconf", "+ping")
_SENTINEL: Final = (
    *("+multi", "+slaveof", "+ping", "+exec", "+subscribe", "+config|rewrite", "+role", "+publish"),
    *("+info", "+client|setname", "+client|kill", "+script|kill"),
)

#: Nobody can log in as the default user. It still needs all rights: Redis 7 replays its log with
#: them, and would otherwise drop every transaction at a start, such as the writes of scripts.
_NOBODY: Final = "user default reset off ~* &* +@all"

_HINTS: Final = f"&{PREFIX}wake:*"


@cache
def worker_commands() -> tuple[str, ...]:
    """Redis's commands that a worker needs: those of its scripts, and its own."""
    called = {name.lower() for name in re.findall(r"redis\.call\('(\w+)'", for_workers())}
    return tuple(sorted(called | set(_WORKER_COMMANDS)))


def rules(redis: tuple[int, int] = (7, 0)) -> dict[str, tuple[str, ...]]:
    """The rules of each user, for a Redis of this version or newer."""
    reading = "%R~" if redis >= (7, 0) else "~"

    def on(these: Iterable[str], to_read: Iterable[str] = ()) -> tuple[str, ...]:
        return (*(f"~{key}" for key in these), *(f"{reading}{key}" for key in to_read))

    of_extensions = tuple(extensions("keys"))
    monitor = (*_MONITOR, *(key for one in of_extensions for key in one.SWEPT))
    api = (*monitor, *_API, *(key for one in of_extensions for key in one.SERVED))
    may_run = tuple(f"+{command}" for command in worker_commands())
    return {
        "plateau-worker": (_HINTS, *on(_QUEUE, _READ_BY_WORKERS), "-@all", *may_run),
        "plateau-monitor": (_HINTS, *on(monitor), *_DATA_COMMANDS),
        "plateau-api": (_HINTS, *on(api, _READ_BY_API), *_DATA_COMMANDS),
        "plateau-admin": (_HINTS, *on([f"{PREFIX}*"]), *_ADMIN_COMMANDS),
        "plateau-replica": ("-@all", *_REPLICA),
        "plateau-sentinel": ("allchannels", "-@all", *_SENTINEL),
    }


def acl_file(passwords: Mapping[str, str], redis: tuple[int, int] = (7, 0)) -> str:
    """The text of an ACL file with these users and their passwords' SHA-256.

    A user without a password cannot be used until it is given one; nobody else is let in.
    """
    lines = [_NOBODY]
    for user, its_rules in rules(redis).items():
        password = passwords.get(user)
        hashed = () if password is None else (f"#{hashlib.sha256(password.encode()).hexdigest()}",)
        lines.append(" ".join(["user", user, "reset", "on", *hashed, "resetchannels", *its_rules]))
    return "\n".join(lines) + "\n"
