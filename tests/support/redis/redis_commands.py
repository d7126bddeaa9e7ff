"""The commands of the script, and some that no caller would give it."""

import json
import re
from typing import Any

from plateau.farm.redis.commands.command import Command
from plateau.farm.redis.scripts import text


def named(name: str, **fields: object) -> Command[Any]:
    """A command of this name with these fields, whatever its own are."""

    class Named(Command[Any]):
        @classmethod
        def lua_name(cls) -> str:
            return name

        def as_json(self) -> str:
            return json.dumps(fields)

    return Named()


def commands(whose: str = "workers|farm", more: str = "") -> set[str]:
    """The names of the commands for ``workers``, for the rest of the ``farm``, or of all."""
    return set(re.findall(rf"^(?:function )?for_(?:{whose})\W+(\w+)", text(more), re.MULTILINE))
