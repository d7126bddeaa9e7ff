"""Watches what Plateau's own code sends to Redis: it writes by one script, so behind the guard.

That script looks at the layout first (`plateau.farm.redis.scripts`). A write by another way
would pass by that, also in a process of another version.
"""

import functools
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, Final
from unittest.mock import patch

import redis.asyncio.client
import redis.client

from plateau.farm.redis import link

ROOT: Final = Path(__file__).parents[3]

#: What any module may send; by the server's own word none of it writes.
READS: Final = {
    *("ACL", "CONFIG", "INFO", "PING", "PUBSUB", "TIME"),
    *("EXISTS", "GET", "MGET", "HEXISTS", "HGET", "HGETALL", "HKEYS", "HMGET", "HVALS"),
    *("HLEN", "SCARD", "SISMEMBER", "SMEMBERS", "XRANGE", "XREAD", "XREVRANGE"),
    *(
        "ZCARD",
        "ZINTER",
        "ZMSCORE",
        "ZRANGE",
        "ZRANGEBYSCORE",
        "ZREVRANGE",
        "ZREVRANGEBYSCORE",
        "ZSCORE",
    ),
}
#: And what one module alone may send: the script, the migrations that make what it guards, and
#: what shortens a log.
RUNS_SCRIPTS: Final = {
    "plateau/farm/redis/scripts.py": {"EVALSHA", "SCRIPT"},
    "plateau/farm/ledger/schema.py": {"EVAL"},
    "plateau/farm/redis/embedded.py": {"BGREWRITEAOF"},
}

#: What was sent beside that, in the whole run.
found: Final[list[str]] = []


@functools.cache
def module_of(file: str) -> str | None:
    """The path of a module of Plateau's within the repository; None of any other."""
    path = Path(file).resolve()
    if not path.is_relative_to(ROOT):
        return None
    module = path.relative_to(ROOT)
    return module.as_posix() if module.parts[0] == "plateau" else None


def _passes_on(module: str) -> bool:
    return module.split(".")[0] == "redis" or module == link.__name__


def _check(command: object, sender: FrameType | None) -> None:
    name = str(command).split()[0].upper()
    while sender is not None and _passes_on(sender.f_globals.get("__name__", "")):
        sender = sender.f_back
    module = None if sender is None else module_of(sender.f_code.co_filename)
    if sender is None or module is None:
        return  # a test prepares something
    if name not in READS | RUNS_SCRIPTS.get(module, set()):
        found.append(f"{module}:{sender.f_lineno} sends {name} to Redis by itself")
        raise AssertionError(found[-1])


def _watched(send: Callable[..., Any]) -> Callable[..., Any]:
    def send_where_it_may(client: Any, *arguments: Any, **options: Any) -> Any:
        _check(arguments[0], sys._getframe(1))
        return send(client, *arguments, **options)

    return send_where_it_may


@contextmanager
def watching() -> Iterator[None]:
    """Refuse what Plateau's code would write by itself in this process, and note it in `found`."""
    clients: tuple[Any, ...] = (redis.client, redis.asyncio.client)
    kinds = [kind for module in clients for kind in (module.Redis, module.Pipeline)]
    patches = [
        patch.object(kind, "execute_command", _watched(kind.execute_command)) for kind in kinds
    ]
    with ExitStack() as stack:
        for one in patches:
            stack.enter_context(one)
        yield
