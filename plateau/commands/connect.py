"""The client that the command line talks with, and ids of jobs as people type them to it."""

import re
import sys
from itertools import islice
from typing import Final

from plateau.client import Client
from plateau.errors import CommandFailed
from plateau.farm.model import versions
from plateau.processes.read_settings import api_key, read_settings

#: A service that has answered and is away then is being started again, maybe by an upgrade.
_ONCE_HEARD_S: Final = 60.0

_BEGINNING: Final = re.compile(r"[0-9a-f]{4,11}")
#: Among so many jobs, the newest ones, a beginning is looked for.
_NEWEST: Final = 1000
_SHOWN: Final = 5


def connect(url: str | None, *, timeout_s: float = 30.0, quiet: bool = False) -> Client:
    """A client of the service at the URL, or of the one that the settings name.

    It does not wait for a service that is not there, but for one that goes away meanwhile. It shows
    the API key of the settings. Unless `quiet`, it says on standard error where the service is of
    another version.

    Raises
    ------
    BadSetting, BadUrl, BadKey
        A PLATEAU_… variable has a value that is not allowed; the URL cannot be that of a service,
        or the key can be none.
    """
    settings = read_settings()
    where = url or settings.url

    def tell(version: str) -> None:
        if not quiet and _series(version) != _series(versions.plateau()):
            print(
                f"plateau: this is Plateau {versions.plateau()}, and the service at {where} is "
                f"{version}: what only one of them knows will fail; install the same version",
                file=sys.stderr,
            )

    return Client(
        where,
        key=api_key(settings),
        patience_s=0.0,
        timeout_s=timeout_s,
        once_heard_s=0.0 if quiet else _ONCE_HEARD_S,
        on_version=tell,
    )


def _series(version: str) -> list[str]:
    """What two versions have in common that know the same: all but the last number."""
    return version.split(".")[:2]


def whole_id(client: Client, given: str) -> str:
    """The id of the only one of the newest jobs whose id begins so; anything else as it was given.

    As much of an id is enough as tells one job from the others, as in git.

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
