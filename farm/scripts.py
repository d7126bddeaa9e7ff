"""The atomic scripts of ``farm/lua``, each opened by a comment that states its contract."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.resources import files
from typing import Any, Final

import redis

from farm import keys, versions
from farm.errors import Refused, WrongLayout
from farm.redis_link import unavailable_as_farm_error
from farm.states import JOB_MOVES

_LUA: Final = files("farm") / "lua"

#: What every script may use, in this order.
_SHARED: Final = ("waiting.lua", "prelude.lua", "outbox.lua", "members.lua")

#: What every script does first: it looks whether the layout is the one that it was written for, so
#: that a process that is older than the data, whenever it wakes up, changes nothing.
_GUARD: Final = """
local layout = redis.call('GET', SCHEMA)
if layout and layout ~= LAYOUT then return redis.error_reply('WRONGLAYOUT ' .. layout) end
"""
_WRONG_LAYOUT: Final = re.compile(r"\bWRONGLAYOUT (\S+)")
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
def _incompatible_as_farm_error() -> Iterator[None]:
    """Raise `WrongLayout` or `Refused` where a script answers that this Plateau does not fit."""
    try:
        yield
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
        self._scripts = {name: client.register_script(text) for name, text in texts().items()}

    def run(self, script: str, *arguments: str | int | float) -> Any:
        """What the script returns; its first comment says what that may be.

        Raises
        ------
        StoreUnavailable
            Redis cannot be reached; whether the script ran is then unknown, and every script
            may be run again.
        WrongLayout
            The data has another layout by now than this Plateau's: nothing was done.
        Refused
            By scripts that say so: the farm does not speak what this Plateau does.
        """
        with unavailable_as_farm_error(), _incompatible_as_farm_error():
            return self._scripts[script](args=list(arguments))

    def run_each(self, script: str, arguments: Sequence[Sequence[str | int | float]]) -> list[Any]:
        """What the script returns for each of these arguments, in one round trip.

        Others may come in between two runs. Raises what `run` does.
        """
        with unavailable_as_farm_error(), _incompatible_as_farm_error():
            pipe = self._redis.pipeline(transaction=False)
            for one in arguments:
                self._scripts[script](args=list(one), client=pipe)
            answers: list[Any] = pipe.execute()
        return answers
