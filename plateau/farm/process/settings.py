"""The settings from the environment, which the entry points read once and hand down."""

import re
from ipaddress import ip_network
from pathlib import Path
from typing import Annotated, Final

import platformdirs
from pydantic import AfterValidator, BeforeValidator, Field, SecretStr, field_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from plateau.farm.model.place_names import DEFAULT_POOL, PlaceName, Tags
from plateau.farm.model.scene_roots import SceneRoot, at_home, read_roots
from plateau.farm.process.log import LogFormat

#: The upper bound of most settings in seconds.
_DAY_S: Final = 86_400.0
#: The upper bound of settings in days: ten years.
_MOST_DAYS: Final = 3_653.0
#: In GiB, more than any machine has.
_MOST_GB: Final = 2.0**20

_HOST_NAME: Final = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*\.?")

_Path = Annotated[Path, AfterValidator(at_home)]
#: A file; "" means none, so that the setting can be undone for one process.
_File = Annotated[_Path | None, BeforeValidator(lambda given: None if given == "" else given)]

_DIRS = platformdirs.PlatformDirs("plateau", appauthor=False)


class Settings(BaseSettings):
    """Every setting of Plateau, read from ``PLATEAU_`` and its name in capitals.

    docs/operations.md says what each is for.
    """

    model_config = SettingsConfigDict(env_prefix="PLATEAU_", frozen=True, extra="ignore")

    redis_url: str | None = Field(None, repr=False)
    redis_user: str | None = None
    redis_password_file: _File = None
    redis_ca: _File = None
    redis_cert: _File = None
    redis_key: _File = None
    redis_sentinel_password_file: _File = None
    blobs: str | None = None
    data: _Path = _DIRS.user_data_path
    cache: _Path = _DIRS.user_cache_path
    url: str = "http://127.0.0.1:8713"
    key: SecretStr | None = None
    key_file: _Path | None = None
    lease_s: float = Field(15.0, gt=0, le=_DAY_S)
    child_timeout_s: float = Field(1200.0, gt=0, le=_DAY_S)
    child_memory_gb: float | None = Field(None, gt=0, le=_MOST_GB)
    max_upload_gb: float = Field(2.0, gt=0, le=_MOST_GB)
    threads: int | None = Field(None, gt=0, le=65_536)
    pool: PlaceName = DEFAULT_POOL
    tags: Annotated[Tags, NoDecode] = ()
    scene_roots: Annotated[tuple[SceneRoot, ...], NoDecode] = ()
    keep_results_days: float | None = Field(None, ge=0, le=_MOST_DAYS, allow_inf_nan=False)
    keep_deleted_days: float = Field(7.0, ge=0, le=_MOST_DAYS, allow_inf_nan=False)
    keep_sums_days: float = Field(3.0, ge=0, le=_MOST_DAYS, allow_inf_nan=False)
    plugins: Annotated[tuple[str, ...], NoDecode] = ()
    webhook_allow: Annotated[tuple[str, ...], NoDecode] = ()
    notify_file: _File = Field(None, repr=False)
    notify: Annotated[Tags, NoDecode] = ()
    notify_troubles: Annotated[Tags, NoDecode] = ()
    alive_file: _Path | None = None
    leave_after_s: float | None = Field(None, gt=0, le=366 * _DAY_S)
    log_format: LogFormat = "text"

    @field_validator("tags", "plugins", "notify", "notify_troubles", "webhook_allow", mode="before")
    @classmethod
    def _separate_words(cls, given: object) -> object:
        return tuple(given.replace(",", " ").split()) if isinstance(given, str) else given

    @field_validator("scene_roots", mode="before")
    @classmethod
    def _read_roots(cls, given: object) -> object:
        return read_roots(given) if isinstance(given, str) else given

    @property
    def heartbeat_s(self) -> float:
        """How often a worker renews its leases: three times in one, so that one may be late.

        After half a lease without any worker's heartbeat the whole farm counts as silent, and no
        lease is reclaimed (slices.lua).
        """
        return min(5.0, self.lease_s / 3)

    @property
    def max_upload_bytes(self) -> int:
        """The most bytes of a scene's upload."""
        return round(self.max_upload_gb * 2**30)

    @property
    def page_url(self) -> str | None:
        """The URL of the farm's page, if it is set."""
        return self.url if "url" in self.model_fields_set else None

    @property
    def hashes(self) -> Path:
        """The table of the hashes of files in scene roots."""
        return self.cache / "hashes.sqlite"

    @field_validator("webhook_allow")
    @classmethod
    def _check_hosts(cls, entries: tuple[str, ...]) -> tuple[str, ...]:
        for entry in entries:
            if not _is_network(entry) and not _HOST_NAME.fullmatch(entry):
                raise ValueError(
                    f"{entry!r} is neither a network, as 10.0.0.0/8, nor the name of a host"
                )
        return entries


def _is_network(text: str) -> bool:
    try:
        ip_network(text, strict=False)
    except ValueError:
        return False
    return True
