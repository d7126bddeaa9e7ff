"""Reads the settings and secrets of the environment; a wrong one raises `BadSetting`."""

from pathlib import Path
from typing import Final

from pydantic import ValidationError

from plateau.errors import PlateauError
from plateau.farm.model import input_errors
from plateau.farm.process.settings import Settings
from plateau.farm.redis import url as redis_url

#: The settings of the connection to Redis, besides its URL.
REDIS_VARIABLES: Final = (
    "PLATEAU_REDIS_USER",
    "PLATEAU_REDIS_PASSWORD_FILE",
    "PLATEAU_REDIS_CA",
    "PLATEAU_REDIS_CERT",
    "PLATEAU_REDIS_KEY",
    "PLATEAU_REDIS_SENTINEL_PASSWORD_FILE",
)


class BadSetting(PlateauError):
    """The value of a PLATEAU_… variable is not allowed, or its file cannot be read."""


def api_key(settings: Settings) -> str | None:
    """The API key in the settings, or in the file that they name; None if they have neither."""
    given = settings.key.get_secret_value().strip() if settings.key is not None else ""
    if settings.key_file is None:
        return given or None
    if given:
        raise BadSetting("set PLATEAU_KEY or PLATEAU_KEY_FILE, not both")
    return secret_in(settings.key_file, "PLATEAU_KEY_FILE")


def farm_settings() -> Settings:
    """The settings of a process that uses Redis; its URL contains the other settings of Redis."""
    settings = read_settings()
    url = settings.redis_url
    if not url:
        return settings.model_copy(update={"redis_url": None})
    try:
        redis_url.check(url)
        if settings.redis_user:
            url = redis_url.with_user(url, settings.redis_user)
        if settings.redis_password_file is not None:
            password = secret_in(settings.redis_password_file, "PLATEAU_REDIS_PASSWORD_FILE")
            url = redis_url.with_password(url, password)
        url = redis_url.with_parameters(url, _parameters(settings, tls=redis_url.uses_tls(url)))
        redis_url.check(url)
    except redis_url.BadRedisUrl as error:
        raise BadSetting(f"PLATEAU_REDIS_URL: {error}") from None
    return settings.model_copy(update={"redis_url": url})


def _parameters(settings: Settings, *, tls: bool) -> dict[str, str]:
    files = {
        "ssl_ca_certs": ("PLATEAU_REDIS_CA", settings.redis_ca),
        "ssl_certfile": ("PLATEAU_REDIS_CERT", settings.redis_cert),
        "ssl_keyfile": ("PLATEAU_REDIS_KEY", settings.redis_key),
    }
    parameters = {}
    for name, (variable, file) in files.items():
        if file is None:
            continue
        if not tls:
            raise BadSetting(f"{variable} is for TLS: PLATEAU_REDIS_URL must begin with rediss")
        if not file.is_file():
            raise BadSetting(f"{variable}: there is no file {file}")
        parameters[name] = str(file)
    if ("ssl_certfile" in parameters) != ("ssl_keyfile" in parameters):
        raise BadSetting("set PLATEAU_REDIS_CERT and PLATEAU_REDIS_KEY together, or neither")
    if settings.redis_sentinel_password_file is not None:
        parameters["sentinel_password"] = secret_in(
            settings.redis_sentinel_password_file, "PLATEAU_REDIS_SENTINEL_PASSWORD_FILE"
        )
    return parameters


def secret_in(file: Path, option: str) -> str:
    """The secret in a file, which `option` names in messages."""
    try:
        secret = file.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or "it is not text"
        raise BadSetting(f"{option}: {file} cannot be read: {why}") from error
    if not secret:
        raise BadSetting(f"{option}: {file} is empty")
    return secret


def read_settings() -> Settings:
    """The settings of the environment."""
    try:
        return Settings()
    except ValidationError as error:
        found = (
            f"PLATEAU_{str(one['loc'][0]).upper()}: {input_errors.message(one)}"
            for one in error.errors()
            if one["type"] != "default_factory_not_called"  # a consequence of another error
        )
        raise BadSetting("; ".join(found)) from error
