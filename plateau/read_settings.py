"""The settings, with an error that names the variable that is wrong."""

from pydantic import ValidationError

from farm.settings import Settings
from plateau.errors import PlateauError


class BadSetting(PlateauError):
    """A PLATEAU_… variable has a value that is not allowed."""


def api_key(settings: Settings) -> str | None:
    """The API key that the settings give or name a file of; None where they do neither.

    Raises
    ------
    BadSetting
        They do both, or the file has no key.
    """
    given = settings.key.get_secret_value().strip() if settings.key is not None else ""
    if settings.key_file is None:
        return given or None
    if given:
        raise BadSetting("set PLATEAU_KEY or PLATEAU_KEY_FILE, not both")
    try:
        key = settings.key_file.read_text().strip()
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or "it is no text"
        raise BadSetting(f"PLATEAU_KEY_FILE: {settings.key_file} cannot be read: {why}") from error
    if not key:
        raise BadSetting(f"PLATEAU_KEY_FILE: {settings.key_file} is empty")
    return key


def read_settings() -> Settings:
    """What the environment says.

    Raises
    ------
    BadSetting
        A value is not allowed; the message names its variable.
    """
    try:
        return Settings()
    except ValidationError as error:
        found = (f"PLATEAU_{str(one['loc'][0]).upper()}: {one['msg']}" for one in error.errors())
        raise BadSetting("; ".join(found)) from error
