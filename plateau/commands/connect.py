"""The client that the command line talks with."""

import sys
from typing import Final

from plateau.client import Client
from plateau.farm.model import versions
from plateau.processes.read_settings import api_key, read_settings

#: A service that has answered and is away then is being started again, maybe by an upgrade.
_ONCE_HEARD_S: Final = 60.0


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
