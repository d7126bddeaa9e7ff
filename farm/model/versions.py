"""The versions that processes must share to work on one farm: a layout of Redis, and a protocol.

The **layout** is the structure of the data in Redis. All running processes work with the same one:
every command checks it first (`plateau.farm.redis.scripts`), so that a process that outlives a
migration can do nothing any more; and a migration waits for the processes that it would shut out
(`plateau.farm.ledger.schema`).

The **protocol** is what processes of one layout expect of each other: the contents of a slice's
spec and of a partial, the schedule of seeds. Each process speaks the versions from `OLDEST` to
`NEWEST`. The farm speaks those that all living monitors and APIs speak, and Redis keeps them; the
lease command gives no slice to a worker that speaks none of them.

To change either:

- Raise `LAYOUT` where an older process would read or write Redis wrongly, with a migration in
  `plateau.farm.ledger.schema`. All older processes must then stop before the first new one works.
- Raise `NEWEST` where only the data between processes changes. Keep `OLDEST` as long as this
  Plateau understands older processes and they understand it: then both work together, and can be
  restarted one by one. Raise it where that ends.
- New fields in Redis need neither where an older process may ignore them, as it does.
"""

from functools import cache
from typing import Final

#: The layout that this Plateau reads and writes.
LAYOUT: Final = 2

#: This Plateau speaks these versions of the protocol and all between.
OLDEST: Final = 2
NEWEST: Final = 2


@cache
def plateau() -> str:
    """This Plateau's own version, such as ``0.1.0``: for people, no decision depends on it."""
    from importlib.metadata import version  # slow to import, and most commands do not need it

    return version("plateau")


def spoken(oldest: int, newest: int) -> str:
    """A range of versions of the protocol in words."""
    return f"protocol {oldest}" if oldest == newest else f"protocols {oldest} to {newest}"


def in_lua() -> str:
    """The versions of this process as Lua, for the script."""
    return (
        f"local LAYOUT, OLDEST, NEWEST, PLATEAU = '{LAYOUT}', {OLDEST}, {NEWEST}, '{plateau()}'\n"
    )
