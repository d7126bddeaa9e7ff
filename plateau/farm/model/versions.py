"""The versions of this Plateau: its own, and that of what processes of one farm must share.

`LAYOUT` stands for the structure of the data in Redis and for what processes expect of each other:
the contents of a slice's spec and of a partial, the schedule of seeds. Each process compares it
with that of the data when it starts, and each command does so before anything else
(`plateau.farm.redis.scripts`). A process of another version changes nothing and ends.

Raise it with every such change. Data of another version is not migrated.
"""

from functools import cache
from typing import Final

LAYOUT: Final = 5


@cache
def plateau() -> str:
    """This Plateau's own version, such as ``0.1.0``."""
    from importlib.metadata import version  # slow to import, and most commands do not need it

    return version("plateau")
