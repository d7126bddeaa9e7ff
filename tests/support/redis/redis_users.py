"""Connections to a real Redis as the users that `plateau redis-acl` makes."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import redis

from plateau.farm.ledger.schema import check_schema
from plateau.farm.ledger.workers import MonitorLife
from plateau.farm.redis.acl import acl_file, rules
from plateau.farm.redis.link import connect
from tests.support.processes.commands import starting

PASSWORD = "a password of a test"
LEASE_S = 60.0

#: Opens a connection as one of the users: ``worker``, ``monitor``, ``api``, ``admin``.
Login = Callable[[str], redis.Redis]


@contextmanager
def users(root: redis.Redis, url: str) -> Iterator[Login]:
    """The users, in a Redis that knows no scripts, at the path of a Unix socket."""
    version = tuple(int(part) for part in root.info()["redis_version"].split(".")[:2])
    for line in acl_file(dict.fromkeys(rules(), PASSWORD), version).splitlines()[1:]:
        root.execute_command("ACL", "SETUSER", *line.split()[1:])
    root.acl_log_reset()
    root.script_flush()  # those of other tests
    path = url.removeprefix("unix://")
    yield from starting(lambda role: connect(f"unix://plateau-{role}:{PASSWORD}@{path}", 120.0))
    for name in rules():
        root.acl_deluser(name)


def monitor_comes(login: Login) -> MonitorLife:
    """A monitor lays out Redis, and says that it lives."""
    monitor = login("monitor")
    check_schema(monitor)
    life = MonitorLife(monitor, "m", LEASE_S)
    life.heartbeat(0)
    return life
