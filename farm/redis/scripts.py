"""The atomic scripts of ``farm/redis/lua``, each opened by a comment that states its contract.

Redis has to know a script before it runs it. Whoever may gives it the text where it does not, so a
farm on an embedded Redis need not think of it. Workers on a Redis with users may not: who can give
Redis a script can give it one that never ends (`plateau.farm.redis.acl`). Monitors and APIs see to
theirs, with each heartbeat, since a Redis that starts again, or takes over, knows no scripts.
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
from plateau.farm.model.errors import NotPermitted, Refused, StoreUnavailable, WrongLayout
from plateau.farm.model.states import JOB_MOVES
from plateau.farm.redis import keys
from plateau.farm.redis.link import unavailable_as_farm_error

_LUA: Final = files("plateau.farm.redis") / "lua"

#: What every script may use, in this order.
_SHARED: Final = ("waiting.lua", "prelude.lua", "outbox.lua", "members.lua")

#: What every script does first: it looks whether the layout is the one that it was written for, so
#: that a process that is older than the data, whenever it wakes up, changes nothing.
_GUARD: Final = """
local layout = redis.call('GET', SCHEMA)
if layout and layout ~= LAYOUT then return redis.error_reply('WRONGLAYOUT ' .. layout) end
"""
_WRONG_LAYOUT: Final = re.compile(r"\bWRONGLAYOUT (\S+)")
#: The scripts that workers run.
WORKER_SCRIPTS: Final = (
    "lease",
    "heartbeat",
    "glimpse",
    "commit",
    "died",
    "hand_back",
    "fail",
    "leave",
    "refused",
)

#: What a script says to whom speaks what the farm does not; see members.lua.
_REFUSED: Final = re.compile(r"\bREFUSED (\d+) (\d+) (\S+)")


def _moves_in_lua() -> str:
    """The table of moves, so that the scripts enforce the one that Python has."""
    rows = (
        f"{start.value} = {{{', '.join(f'{end.value} = true' for end in sorted(ends))}}}"
        for start, ends in JOB_MOVES.items()
    )
    return f"local MOVES = {{{', '.join(rows)}}}\n"


def _whole(shared: str, script: str) -> str:
    """The script as Redis runs it: wherever it returns, what it did is filed and told after it."""
    return (
        f"{shared}\nlocal function script()\n{script}\nend\n{_GUARD}"
        "local answer = script()\nfile_changed()\nfill_outbox()\nreturn answer\n"
    )


@cache
def texts() -> dict[str, str]:
    """The scripts by name, each with what all of them share."""
    numbers = versions.in_lua() + keys.LUA + _moves_in_lua()
    shared = numbers + "".join((_LUA / name).read_text() for name in _SHARED)
    return {
        file.name.removesuffix(".lua"): _whole(shared, file.read_text())
        for file in _LUA.iterdir()
        if file.name.endswith(".lua") and file.name not in _SHARED
    }


@contextmanager
def _answers_as_farm_errors() -> Iterator[None]:
    """Raise `WrongLayout` or `Refused` where a script answers that this Plateau does not fit.

    And `StoreUnavailable` where Redis forgot the script as it was asked for.
    """
    try:
        yield
    except redis.exceptions.NoScriptError as error:
        raise StoreUnavailable(f"Redis has just forgotten its scripts: {error}") from None
    except redis.exceptions.ResponseError as error:
        if wrong := _WRONG_LAYOUT.search(str(error)):
            raise WrongLayout(wrong[1]) from None
        if refused := _REFUSED.search(str(error)):
            raise Refused(int(refused[1]), int(refused[2]), refused[3]) from None
        raise


class Scripts:
    """Runs the scripts by name on one Redis client."""

    def __init__(self, client: redis.Redis) -> None:
        self._redis = client
        self._texts = texts()

    def run(self, script: str, *arguments: str | int | float) -> Any:
        """What the script returns; its first comment says what that may be.

        Raises
        ------
        StoreUnavailable
            Redis cannot be reached; whether the script ran is then unknown, and every script
            may be run again. Or it does not know the script, and this user may not load it.
        WrongLayout
            The data has another layout by now than this Plateau's: nothing was done.
        Refused
            By scripts that say so: the farm does not speak what this Plateau does.
        """
        with unavailable_as_farm_error(), _answers_as_farm_errors():
            try:
                return self._call(self._redis, script, arguments)
            except redis.exceptions.NoScriptError:
                self._load([script])
                return self._call(self._redis, script, arguments)

    def run_each(self, script: str, arguments: Sequence[Sequence[str | int | float]]) -> list[Any]:
        """What the script returns for each of these arguments, in one round trip.

        Others may come in between two runs. Raises what `run` does.
        """
        with unavailable_as_farm_error(), _answers_as_farm_errors():
            self._load_unknown([script])
            pipe = self._redis.pipeline(transaction=False)
            for one in arguments:
                self._call(pipe, script, one)
            answers: list[Any] = pipe.execute()
        return answers

    def serve_workers(self) -> None:
        """See to it that Redis knows what workers run; raises what `run` does."""
        with unavailable_as_farm_error():
            self._load_unknown(WORKER_SCRIPTS)

    def _call(self, client: redis.Redis, script: str, arguments: Sequence[Any]) -> Any:
        return client.evalsha(_sha1(self._texts[script]), 0, *arguments)

    def _load_unknown(self, scripts: Sequence[str]) -> None:
        known = self._redis.script_exists(*(_sha1(self._texts[name]) for name in scripts))
        self._load(name for name, is_known in zip(scripts, known, strict=True) if not is_known)

    def _load(self, scripts: Iterable[str]) -> None:
        try:
            with unavailable_as_farm_error():
                for name in scripts:
                    self._redis.script_load(self._texts[name])
        except NotPermitted:
            raise StoreUnavailable(
                f"Redis does not know the scripts of Plateau {versions.plateau()}, and this "
                "process may not load them: it waits for a monitor or an API of this version"
            ) from None


@cache
def _sha1(text: str) -> str:
    """By which Redis knows a script."""
    return hashlib.sha1(text.encode(), usedforsecurity=False).hexdigest()
