"""The client of the command line."""

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from plateau.client import Client

#: A service that stops answering may only be restarting, for example for an upgrade.
_ONCE_HEARD_S: Final = 60.0


def connect(url: str | None, *, timeout_s: float = 30.0, quiet: bool = False) -> "Client":
    """A client of the service at the URL, or of the settings' URL, with the settings' API key.

    It waits for a service only after that has answered once. Unless `quiet`, its first call raises
    `OtherVersion` if the service has another version.

    Raises `BadSetting`, `BadUrl` or `BadKey` if a setting, the URL or the key is not allowed.
    """
    from plateau.client import Client
    from plateau.errors import OtherVersion
    from plateau.farm.model import versions
    from plateau.processes.read_settings import api_key, read_settings

    settings = read_settings()
    where = url or settings.url

    def compare(version: str) -> None:
        if not quiet and version != versions.plateau():
            raise OtherVersion(
                f"this is Plateau {versions.plateau()}, and the service at {where} is Plateau "
                f"{version}: install the same version here"
            )

    return Client(
        where,
        key=api_key(settings),
        patience_s=0.0,
        timeout_s=timeout_s,
        once_heard_s=0.0 if quiet else _ONCE_HEARD_S,
        on_version=compare,
    )
