"""Commands that store API keys, and note their use."""

from plateau.farm.redis.commands.command import Command


class PutKey(Command[bool]):
    """Store a key; answers whether the stored one was still `instead_of`."""

    key: str
    instead_of: str  #: JSON; "" for a new key
    known: str  #: JSON


class NoteUse(Command[None]):
    """Note that a key is used."""

    key: str
