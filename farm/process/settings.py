"""The settings from the environment, which the entry points read once and hand down."""

import re
from ipaddress import ip_network
from pathlib import Path
from typing import Annotated, Final, Literal

import platformdirs
from pydantic import BeforeValidator, Field, SecretStr, ValidationInfo, field_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from plateau.farm.model.place_names import DEFAULT_POOL, PlaceName, Tags
from plateau.farm.model.scene_roots import SceneRoot, read_roots, root_tag

LogFormat = Literal["text", "json"]

#: Least heartbeats in a lease, so that one may be late. After half a lease without any worker's
#: heartbeat the whole farm counts as silent, and no lease is reclaimed (slices.lua).
LEASE_HEARTBEATS: Final = 2.5

#: The upper bound of most settings in seconds.
_DAY_S: Final = 86_400.0
#: The upper bound of settings in days: ten years.
_MOST_DAYS: Final = 3_653.0
#: In GiB, more than any machine has.
_MOST_GB: Final = 2.0**20

_HOST_NAME: Final = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*\.?")

#: A file; "" means none, so that the setting can be undone for one process.
_File = Annotated[Path | None, BeforeValidator(lambda given: None if given == "" else given)]

_DIRS = platformdirs.PlatformDirs("plateau", appauthor=False)


class Settings(BaseSettings):
    """Every setting of Plateau; each is read from ``PLATEAU_`` and its name in capitals."""

    model_config = SettingsConfigDict(env_prefix="PLATEAU_", frozen=True, extra="ignore")

    redis_url: str | None = Field(
        None, repr=False, description="Redis to use; unset, `plateau up` starts an embedded one"
    )
    redis_user: str | None = Field(None, description="who asks there, where the URL does not say")
    redis_password_file: _File = Field(
        None, description="a file with the password of the URL's user, so that it is not in the URL"
    )
    redis_ca: _File = Field(
        None,
        description="certificates of who may sign that of a rediss:// Redis; unset, those that the "
        "machine trusts",
    )
    redis_cert: _File = Field(
        None, description="certificate that is shown to a rediss:// Redis that asks for one"
    )
    redis_key: _File = Field(None, description="the private key of that certificate")
    redis_sentinel_password_file: _File = Field(
        None, description="a file with the password of the sentinels, where they want one"
    )
    blobs: str | None = Field(
        None,
        description="blob store: a folder, or s3://BUCKET/PREFIX with AWS_… for its credentials "
        "and endpoint; unset, a folder under the data one",
    )
    data: Path = Field(
        _DIRS.user_data_path, description="folder of the embedded Redis and the local blobs"
    )
    cache: Path = Field(
        _DIRS.user_cache_path,
        description="folder of unpacked scenes, compiled kernels and new uploads",
    )
    url: str = Field(
        "http://127.0.0.1:8713", description="the service that the client commands talk to"
    )
    key: SecretStr | None = Field(
        None, description="API key that the client commands show the service"
    )
    key_file: Path | None = Field(None, description="a file with that key, instead")
    key_requests_per_minute: float = Field(
        1200.0, gt=0, le=1e6, description="how many requests a minute a new API key may make"
    )
    key_burst: int = Field(
        200, ge=1, le=1_000_000, description="and how many at once, after a pause"
    )
    key_upload_gb: float | None = Field(
        None,
        gt=0,
        le=_MOST_GB,
        description="largest upload of a new API key; unset, PLATEAU_MAX_UPLOAD_GB",
    )
    key_scenes_gb: float | None = Field(
        50.0, gt=0, le=2**30, description="how much a new API key may have stored of scenes"
    )
    key_open_jobs: int = Field(
        10_000,
        ge=1,
        le=1_000_000_000,
        description="how many jobs of a new API key may be open at once",
    )
    lease_s: float = Field(
        15.0, gt=0, le=_DAY_S, description="a lease not renewed for this long may be reclaimed"
    )
    heartbeat_s: float = Field(
        default_factory=lambda known: min(5.0, known["lease_s"] / 3),
        gt=0,
        le=_DAY_S,
        description="a worker renews its leases this often; unset, 5 or a third of the lease",
    )
    pass_timeout_s: float = Field(
        1200.0,
        gt=0,
        le=_DAY_S,
        description="how long a render child may work at a part of a pass, usually about a second, "
        "before it is killed, while its scene's pace is not known",
    )
    load_timeout_s: float = Field(
        1200.0,
        gt=0,
        le=_DAY_S,
        description="how long a render child may work at loading a scene before it is killed",
    )
    child_memory_gb: float | None = Field(
        None,
        gt=0,
        le=_MOST_GB,
        description="memory limit of a render child; unset, 80 % of the machine's, divided among "
        "PLATEAU_WORKERS_HERE",
    )
    workers_here: int = Field(
        1,
        gt=0,
        le=4096,
        description="how many workers share this machine's memory; `plateau up` sets it",
    )
    max_upload_gb: float = Field(
        2.0, gt=0, le=_MOST_GB, description="largest scene that the API takes"
    )
    threads: int | None = Field(
        None,
        gt=0,
        le=65_536,
        description="threads of a render child; unset, all cores of the machine",
    )
    pool: PlaceName = Field(
        DEFAULT_POOL, description="a worker renders the jobs of this pool alone"
    )
    tags: Annotated[Tags, NoDecode] = Field(
        (), description="what jobs may require of a worker, separated by commas, as gpu,highmem"
    )
    scene_roots: Annotated[tuple[SceneRoot, ...], NoDecode] = Field(
        (),
        description="scene roots, for the API and the workers, separated by commas: NAME=PATH, and "
        "|PATH for each path by which other platforms know it",
    )
    keep_results_days: float | None = Field(
        None,
        ge=0,
        le=_MOST_DAYS,
        allow_inf_nan=False,
        description="days after which finished jobs are removed; unset, they stay",
    )
    keep_deleted_days: float = Field(
        7.0,
        ge=0,
        le=_MOST_DAYS,
        allow_inf_nan=False,
        description="days for which a deleted job can be restored, before a sweep removes it",
    )
    keep_sums_days: float = Field(
        3.0,
        ge=0,
        le=_MOST_DAYS,
        allow_inf_nan=False,
        description="days for which an ended job without kept slices can be continued; "
        "0 keeps no sums",
    )
    keep_scenes_days: float | None = Field(
        None,
        ge=0,
        le=_MOST_DAYS,
        allow_inf_nan=False,
        description="days without use after which scenes of no job are removed; unset, they stay",
    )
    plugins: Annotated[tuple[str, ...], NoDecode] = Field(
        (),
        description="types of plugin, separated by commas, that workers have beside Mitsuba's own: "
        "the API refuses scenes that ask for others",
    )
    webhook_allow: Annotated[tuple[str, ...], NoDecode] = Field(
        (),
        description="networks and host names, separated by commas, that may be sent webhooks "
        "though they are private, by http too",
    )
    notify_file: _File = Field(
        None,
        repr=False,
        description="a file with the targets of notifications, for the API and the monitors: "
        "lines of a name, a blank and a URL of apprise",
    )
    notify: Annotated[Tags, NoDecode] = Field(
        (), description="those of them, separated by commas, that are notified of every job"
    )
    notify_troubles: Annotated[Tags, NoDecode] = Field(
        (),
        description="those of them that are notified of the farm's troubles, for the monitors: a "
        "job that no worker can render, a worker that fails, a full store",
    )
    trouble_after_s: float = Field(
        120.0, ge=0, le=_DAY_S, description="for so long a trouble lasts before it is told"
    )
    commands_file: _File = Field(
        None,
        repr=False,
        description="a file with the commands that jobs may start at their ends, for the API and "
        "the monitors: lines of a name, a blank and a command",
    )
    command_limit_s: float = Field(
        3600.0, gt=0, le=7 * _DAY_S, description="after this time a monitor ends such a command"
    )
    alive_file: Path | None = Field(
        None,
        description="a file that a worker or a monitor touches at each heartbeat, for probes; it "
        "says why a worker takes no work",
    )
    label: str | None = Field(
        None,
        max_length=200,
        description="what a worker was started as elsewhere, as slurm:1234_5, shown with it",
    )
    leave_after_s: float | None = Field(
        None,
        gt=0,
        le=366 * _DAY_S,
        description="a worker that had nothing to do for so long ends; unset, it stays",
    )
    when_refused: Literal["exit", "wait"] = Field(
        "exit",
        description="what a process does that cannot work with the farm's data or the farm's other "
        "processes: exit with code 76, or wait until it can",
    )
    log_format: LogFormat = Field(
        "text", description="how processes log: text, or json, an object for each line"
    )

    @field_validator("heartbeat_s")
    @classmethod
    def _fits_the_lease(cls, given: float, info: ValidationInfo) -> float:
        lease_s = info.data.get("lease_s", given * LEASE_HEARTBEATS)
        if lease_s < given * LEASE_HEARTBEATS:
            raise ValueError(
                f"a worker that renews its leases every {given:g} s loses those of {lease_s:g} s: "
                f"set PLATEAU_LEASE_S to {given * LEASE_HEARTBEATS:g} at least, or "
                f"PLATEAU_HEARTBEAT_S to {lease_s / LEASE_HEARTBEATS:g} at most"
            )
        return given

    @field_validator("tags", "plugins", "notify", "notify_troubles", mode="before")
    @classmethod
    def _separate_words(cls, given: object) -> object:
        return tuple(given.replace(",", " ").split()) if isinstance(given, str) else given

    @field_validator("scene_roots", mode="before")
    @classmethod
    def _read_roots(cls, given: object) -> object:
        return read_roots(given) if isinstance(given, str) else given

    @property
    def page_url(self) -> str | None:
        """The URL of the farm's page, if it is set."""
        return self.url if "url" in self.model_fields_set else None

    @property
    def all_tags(self) -> Tags:
        """A worker's tags, with those of its scene roots."""
        return (*self.tags, *(root_tag(root.name) for root in self.scene_roots))

    @property
    def hashes(self) -> Path:
        """The table of the hashes of files in scene roots."""
        return self.cache / "hashes.sqlite"

    @field_validator("webhook_allow", mode="before")
    @classmethod
    def _separate(cls, given: object) -> object:
        if not isinstance(given, str):
            return given
        entries = given.replace(",", " ").split()
        for entry in entries:
            if not _is_network(entry) and not _HOST_NAME.fullmatch(entry):
                raise ValueError(
                    f"{entry!r} is neither a network, as 10.0.0.0/8, nor the name of a host"
                )
        return tuple(entries)


def _is_network(text: str) -> bool:
    try:
        ip_network(text, strict=False)
    except ValueError:
        return False
    return True
