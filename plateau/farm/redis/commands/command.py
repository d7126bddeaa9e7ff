"""The base of all commands."""

import json
import re
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Generic, TypeVar, get_args

from pydantic import BeforeValidator, TypeAdapter
from typing_extensions import dataclass_transform

Reply = TypeVar("Reply")
Item = TypeVar("Item")

#: A list in a reply; Lua has one kind of table, so an empty list comes as an object.
Items = Annotated[tuple[Item, ...], BeforeValidator(lambda found: found or ())]


@dataclass_transform(frozen_default=True, kw_only_default=True)
class Command(Generic[Reply]):
    """A command of the script, a dataclass; Lua gets a table of its fields that are not None.

    JSON from Lua has 14 digits, so a number that must come back to the bit passes as text.
    """

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        dataclass(frozen=True, kw_only=True)(cls)

    @classmethod
    @cache
    def lua_name(cls) -> str:
        """Its name in Lua."""
        return re.sub(r"(?<!^)(?=[A-Z])", "_", cls.__name__).lower()

    def as_json(self) -> str:
        """Its fields for the script."""
        given = {name: value for name, value in vars(self).items() if value is not None}
        return json.dumps(given, ensure_ascii=False, allow_nan=False, default=vars)

    def read_reply(self, text: str) -> Reply:
        """The script's reply to it."""
        kind: Any = type(self)
        found: Reply = _adapter(kind).validate_json(text)
        return found


@cache
def _adapter(command: Any) -> TypeAdapter[Any]:
    """Reads replies to a command of this class; the type is in the brackets behind its base."""
    (base,) = command.__orig_bases__
    return TypeAdapter(get_args(base)[0])
