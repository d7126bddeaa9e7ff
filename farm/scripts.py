"""The atomic scripts of ``farm/lua``, each opened by a comment that states its contract."""

from importlib.resources import files
from typing import Any, Final

import redis

from farm import keys
from farm.redis_link import unavailable_as_farm_error
from farm.states import JOB_MOVES

_LUA: Final = files("farm") / "lua"


def _moves_in_lua() -> str:
    """The table of moves, so that the scripts enforce the one that Python has."""
    rows = (
        f"{start.value} = {{{', '.join(f'{end.value} = true' for end in sorted(ends))}}}"
        for start, ends in JOB_MOVES.items()
    )
    return f"local MOVES = {{{', '.join(rows)}}}\n"


class Scripts:
    """Runs the scripts by name on one Redis client."""

    def __init__(self, client: redis.Redis) -> None:
        prelude = keys.LUA + _moves_in_lua() + (_LUA / "prelude.lua").read_text()
        self._scripts = {
            file.name.removesuffix(".lua"): client.register_script(prelude + file.read_text())
            for file in _LUA.iterdir()
            if file.name.endswith(".lua") and file.name != "prelude.lua"
        }

    def run(self, script: str, *arguments: str | int | float) -> Any:
        """What the script returns; its first comment says what that may be.

        Raises
        ------
        StoreUnavailable
            Redis cannot be reached; whether the script ran is then unknown, and every script
            may be run again.
        """
        with unavailable_as_farm_error():
            return self._scripts[script](args=list(arguments))
