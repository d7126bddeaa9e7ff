"""The client that the command line talks with."""

from plateau.client import Client
from plateau.read_settings import api_key, read_settings


def connect(url: str | None, *, timeout_s: float = 30.0) -> Client:
    """A client of the service at the URL, or of the one that the settings name; it does not wait.

    It shows the API key of the settings.

    Raises
    ------
    BadSetting, BadUrl, BadKey
        A PLATEAU_… variable has a value that is not allowed; the URL cannot be that of a service,
        or the key can be none.
    """
    settings = read_settings()
    return Client(url or settings.url, key=api_key(settings), patience_s=0.0, timeout_s=timeout_s)
