"""Commands for the script that no caller would give it."""

import json
from dataclasses import dataclass
from typing import Any

from plateau.farm.redis.commands.command import Command


def named(name: str, **fields: object) -> Command[Any]:
    """A command of this name with these fields, whatever its own are."""

    @dataclass(frozen=True, kw_only=True)
    class Named(Command[Any]):
        @classmethod
        def lua_name(cls) -> str:
            return name

        def as_json(self) -> str:
            return json.dumps(fields)

    return Named()
