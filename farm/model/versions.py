"""What has to fit together for processes to share a farm: a layout of Redis, and a protocol.

The **layout** is what lies where in Redis. All processes that run at a time work with the same one:
every command looks at it before it does anything (`plateau.farm.redis.scripts`), so one that runs
past a migration can do nothing any more; and a migration waits for those that it would shut out
(`plateau.farm.ledger.schema`).

The **protocol** is what processes that share a layout expect of each other: what is in a slice's
spec, what a partial holds, how its seeds are drawn. Each process speaks some versions of it, from
`OLDEST` to `NEWEST`. What all living monitors and APIs speak is what the farm speaks, kept in
Redis; a worker that speaks none of it is given no slice, by the command that gives them.

To change either:

- Raise `LAYOUT` where an older process would read or write Redis wrongly, with a migration in
  `plateau.farm.ledger.schema`. All older processes then have to stop before the first new one can
  work.
- Raise `NEWEST` where only what passes between processes changes. Leave `OLDEST` as long as this
  Plateau does right with what the older ones say and makes for them what they understand: then they
  work together, and can be restarted one by one. Raise it where that ends.
- Fields that are added to what Redis holds need neither where an older process may ignore them, as
  it does.
"""

from functools import cache
from typing import Final

#: The layout that this Plateau reads and writes.
LAYOUT: Final = 1

#: The versions of the protocol that this Plateau speaks: these and all between.
OLDEST: Final = 2
NEWEST: Final = 2


@cache
def plateau() -> str:
    """This Plateau's own version, such as ``0.1.0``: for people; nothing is decided by it."""
    from importlib.metadata import version  # takes a while, and most commands never ask

    return version("plateau")


def spoken(oldest: int, newest: int) -> str:
    """Versions of the protocol in words."""
    return f"protocol {oldest}" if oldest == newest else f"protocols {oldest} to {newest}"


def in_lua() -> str:
    """The same numbers for the script: it says what the process speaks that runs it."""
    return (
        f"local LAYOUT, OLDEST, NEWEST, PLATEAU = '{LAYOUT}', {OLDEST}, {NEWEST}, '{plateau()}'\n"
    )
