"""Ids of jobs as people type them: as much as tells one job from the others, as in git."""

import re
from itertools import islice
from typing import Final

from plateau.client import Client
from plateau.errors import CommandFailed

_BEGINNING: Final = re.compile(r"[0-9a-f]{4,11}")
#: Among so many jobs, the newest ones, a beginning is looked for.
_NEWEST: Final = 1000
_SHOWN: Final = 5


def whole_id(client: Client, given: str) -> str:
    """The id of the only one of the newest jobs whose id begins so; anything else as it was given.

    Raises
    ------
    CommandFailed
        No job's id begins so, or several do.
    """
    if not _BEGINNING.fullmatch(given):
        return given
    newest = [job.id for job in islice(client.all_jobs(), _NEWEST)]
    found = [job_id for job_id in newest if job_id.startswith(given)]
    if not found:
        among = f" of the newest {_NEWEST:,}" if len(newest) == _NEWEST else ""
        raise CommandFailed(f"no job{among} has an id that begins with {given}; see `plateau list`")
    if len(found) > 1:
        more = ", …" if len(found) > _SHOWN else ""
        raise CommandFailed(f"{given} may be {', '.join(found[:_SHOWN])}{more}: give more of it")
    return found[0]
