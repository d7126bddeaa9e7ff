"""The one script of ``plateau/farm/redis/lua``: each write to Redis is an atomic command of it.

The script is assembled from files: first the functions that commands share, then the commands by
subject, each with a comment that states its contract, and last ``dispatch.lua``, which checks the
layout and runs the command asked for.

Redis runs only a script that was loaded. A process with the right to load it does so when it is
missing. Workers on a Redis with users lack the right, since they could load an endless script
(`plateau.farm.redis.acl`). Monitors and APIs load it for them with each heartbeat: a Redis that
restarts, or takes over, has no scripts.
"""

import hashlib
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.resources import files
from typing import Any, Final

import redis

from plateau.farm.model import versions
from plateau.farm.model.errors import Incompatible, NotPermitted, StoreUnavailable
from plateau.farm.model.states import JOB_MOVES
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.command import Command, Reply

_LUA: Final = files("plateau.farm.redis") / "lua"

#: The shared functions, a file for each namespace; these and base.lua may use each other.
_NAMESPACES: Final = {
    "Waiting": "waiting",
    "Outbox": "outbox",
    "Job": "jobs",
    "Slice": "slices",
    "New": "new_jobs",
    "After": "after",
}
#: The subjects of commands: for workers, and all others.
_FOR_WORKERS: Final = ("lease", "slices", "workers")
_FOR_FARM: Final = (
    *("jobs", "deletions", "owners", "shots", "scenes", "sweeps", "notices"),
    *("members", "api_keys", "troubles"),
)

_WRONG_LAYOUT: Final = re.compile(r"\bWRONGLAYOUT (\S+)")


def _moves_in_lua() -> str:
    """Python's table of a job's moves, for the script to enforce."""
    rows = (
        f"{start.value} = {{{', '.join(f'{end.value} = true' for end in sorted(ends))}}}"
        for start, ends in JOB_MOVES.items()
    )
    return f"local MOVES = {{{', '.join(rows)}}}\n"


def _part(name: str) -> str:
    """The text of a file, in a block that keeps its locals."""
    return f"do\n{(_LUA / f'{name}.lua').read_text(encoding='utf-8')}end\n"


def library() -> str:
    """The functions that commands share."""
    return "".join(
        (
            f"local LAYOUT = '{versions.LAYOUT}'\n",
            keys.LUA,
            _moves_in_lua(),
            (_LUA / "base.lua").read_text(encoding="utf-8"),
            f"local {', '.join(_NAMESPACES)} = {', '.join('{}' for _ in _NAMESPACES)}\n",
            *map(_part, _NAMESPACES.values()),
        )
    )


def _commands(subjects: Iterable[str]) -> str:
    return "".join(_part(f"commands/{subject}") for subject in subjects)


def for_workers() -> str:
    """All Lua that runs for a worker."""
    return library() + _commands(_FOR_WORKERS) + (_LUA / "dispatch.lua").read_text(encoding="utf-8")


@cache
def text(more: str = "") -> str:
    """The script as Redis runs it, with more commands for the farm, such as an extension's."""
    return "".join(
        (
            library(),
            "local for_workers, for_farm, subjects = {}, {}, {}\n",
            _commands(_FOR_WORKERS),
            # Defined only when one of them is asked for, to save time for workers.
            *(
                f"subjects[#subjects + 1] = function()\n{_commands([one])}end\n"
                for one in _FOR_FARM
            ),
            f"subjects[#subjects + 1] = function()\n{more}end\n" if more else "",
            (_LUA / "dispatch.lua").read_text(encoding="utf-8"),
        )
    )


@contextmanager
def _answers_as_farm_errors() -> Iterator[None]:
    """Raise `Incompatible` where the script answers so.

    And `StoreUnavailable` where Redis has just forgotten the script.
    """
    try:
        yield
    except redis.exceptions.NoScriptError as error:
        raise StoreUnavailable(f"Redis has just forgotten its scripts: {error}") from None
    except redis.exceptions.ResponseError as error:
        if wrong := _WRONG_LAYOUT.search(str(error)):
            raise Incompatible(wrong[1]) from None
        raise


class Scripts:
    """Runs commands of the script on one Redis client, and those that `more` adds in Lua."""

    def __init__(self, client: RedisClient, more: str = "") -> None:
        self._redis = client
        self._text = text(more)
        self._sha1 = hashlib.sha1(self._text.encode(), usedforsecurity=False).hexdigest()

    def run(self, command: Command[Reply]) -> Reply:
        """Run the command and return its answer.

        Raises
        ------
        StoreUnavailable
            Redis cannot be reached; the command may have been done, and every command may be
            repeated. Or Redis lacks the script, and this user may not load it.
        Incompatible
            The data has another layout than this Plateau's: nothing was done.
        """
        with _answers_as_farm_errors():
            try:
                text = self._redis.evalsha(*self._said(command))
            except redis.exceptions.NoScriptError:
                self._load()
                text = self._redis.evalsha(*self._said(command))
        return command.read_reply(text)

    def run_each(self, commands: Sequence[Command[Reply]]) -> list[Reply]:
        """Run the commands in one round trip and return their answers; raises as `run` does.

        Other clients' commands may run between them.
        """
        self.load()
        with _answers_as_farm_errors():
            pipe = self._redis.pipeline(transaction=False)
            for command in commands:
                pipe.evalsha(*self._said(command))
            texts: list[str] = pipe.execute()
        return [command.read_reply(text) for command, text in zip(commands, texts, strict=True)]

    def _said(self, command: Command[Any]) -> tuple[str, int, str, str]:
        return self._sha1, 0, command.lua_name(), command.as_json()

    def load(self) -> None:
        """Load the script if Redis lacks it, for workers, too; raises as `run` does."""
        [known] = self._redis.script_exists(self._sha1)
        if not known:
            self._load()

    def _load(self) -> None:
        try:
            self._redis.script_load(self._text)
        except NotPermitted:
            raise StoreUnavailable(
                f"Redis does not know the script of Plateau {versions.plateau()}, and this "
                "process may not load it: it waits for a monitor or an API of this version"
            ) from None


class OnRedis:
    """What reads one Redis by its client, and writes to it by commands of the script."""

    def __init__(self, client: RedisClient) -> None:
        self._redis = client
        self._scripts = Scripts(client)
