"""Checks a Redis for its fitness to carry a farm, for `plateau doctor`."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final
from urllib.parse import urlsplit

import redis

from plateau.farm.model.errors import FarmError, NotPermitted
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.link import connect
from plateau.farm.redis.url import (
    BadRedisUrl,
    is_loopback,
    sentinels_of,
    uses_tls,
    without_password,
)

_OLDEST: Final = (6, 2)
_RESTRICTED: Final = "plateau-"


@dataclass(frozen=True)
class Finding:
    """The result of one check."""

    name: str
    detail: str  #: with the remedy, if it is not ok
    ok: bool = True
    needed: bool = False  #: whether nothing works without it


def examine(url: str) -> Iterator[Finding]:
    """The findings about the Redis at the URL, within the rights of its user; never a password."""
    where = without_password(url)
    try:
        with connect(url) as client:
            client.ping()
            yield Finding("Redis", f"{where} answers", needed=True)
            yield _user(client, url)
            yield _encryption(url)
            yield from _server(client)
    except (FarmError, BadRedisUrl) as error:
        yield Finding("Redis", f"{where}: {error}", ok=False, needed=True)


def _user(client: RedisClient, url: str) -> Finding:
    try:
        user = client.acl_whoami()
    except NotPermitted:
        return Finding("Redis user", "one that may not even ask for its name")
    ok = user.startswith(_RESTRICTED) or _is_here(url)
    too_much = (
        f"{user}, who may do more than a process of Plateau's needs: give each kind a user of its "
        "own, as `plateau redis-acl` makes them"
    )
    return Finding("Redis user", user if ok else too_much, ok=ok)


def _encryption(url: str) -> Finding:
    if uses_tls(url):
        return Finding("Redis over TLS", "yes")
    if _is_here(url):
        return Finding("Redis over TLS", "no, and it never leaves this machine")
    told = (
        "no: others on the network can read all, passwords too; begin PLATEAU_REDIS_URL with rediss"
    )
    return Finding("Redis over TLS", told, ok=False)


def _server(client: RedisClient) -> Iterator[Finding]:
    try:
        about: dict[str, Any] = client.info()
    except NotPermitted:
        detail = "this user may not ask, as it should be for workers; plateau-admin may"
        yield Finding("Redis version and persistence", detail)
        return
    version = tuple(int(part) for part in str(about["redis_version"]).split(".")[:2])
    known = f"{about['redis_version']}"
    if version < _OLDEST:
        known += ": Plateau needs 6.2 or newer"
    yield Finding("Redis version", known, ok=version >= _OLDEST, needed=True)
    yield _role(about)
    yield _persistence(client, about)
    yield _eviction(about)


def _role(about: dict[str, Any]) -> Finding:
    if about["role"] != "master":
        told = "a replica, which takes no writes: name its master, or the sentinels that know it"
        return Finding("Redis role", told, ok=False, needed=True)
    replicas = about["connected_slaves"]
    return Finding("Redis role", f"master of {replicas} replicas" if replicas else "on its own")


def _persistence(client: RedisClient, about: dict[str, Any]) -> Finding:
    name = "Redis persistence"
    if not about["aof_enabled"]:
        told = "appendonly no: a power loss would lose acknowledged writes; set `appendonly yes`"
        return Finding(name, told, ok=False)
    if about["aof_last_write_status"] != "ok":
        return Finding(name, "its last write failed: is its disk full?", ok=False)
    try:
        policy = client.config_get("appendfsync").get("appendfsync")
    except (NotPermitted, redis.exceptions.ResponseError):  # the latter from a managed Redis
        return Finding(name, "appendonly yes; appendfsync is not for this user to ask")
    if policy == "always":
        return Finding(name, "appendonly yes, appendfsync always")
    told = f"appendfsync {policy}: a power loss would lose the last writes; set `always`"
    return Finding(name, told, ok=False)


def _eviction(about: dict[str, Any]) -> Finding:
    policy, most = about.get("maxmemory_policy", "unknown"), about.get("maxmemory", 0)
    if policy == "noeviction" or not most:
        return Finding("Redis memory", f"{policy}, {about['used_memory_human']} used")
    told = f"maxmemory-policy {policy}: when memory is full, it drops jobs; set `noeviction`"
    return Finding("Redis memory", told, ok=False)


def _is_here(url: str) -> bool:
    """Whether the connection stays on this machine."""
    sentinels = sentinels_of(url)
    if sentinels is not None:
        return all(is_loopback(host) for host, _ in sentinels.addresses)
    parts = urlsplit(url)
    return parts.scheme == "unix" or is_loopback(parts.hostname or "")
