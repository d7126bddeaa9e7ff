"""The settings, with an error that names the variable that is wrong."""

from pydantic import ValidationError

from farm.settings import Settings


class BadSetting(Exception):
    """A PLATEAU_… variable has a value that is not allowed."""


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
