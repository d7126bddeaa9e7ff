"""What the environment says, read once by the entry points and handed down."""

from pathlib import Path
from typing import Literal

import platformdirs
from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict

LogFormat = Literal["text", "json"]

_DIRS = platformdirs.PlatformDirs("plateau", appauthor=False)


class Settings(BaseSettings):
    """Every setting of Plateau; each is read from ``PLATEAU_`` and its name in capitals."""

    model_config = SettingsConfigDict(env_prefix="PLATEAU_", frozen=True, extra="ignore")

    redis_url: str | None = Field(
        None, description="Redis to use; unset, `plateau up` starts an embedded one"
    )
    blobs: str | None = Field(
        None, description="blob store: a folder or an s3:// URL; unset, a folder under the data one"
    )
    data: Path = Field(
        _DIRS.user_data_path, description="folder of the embedded Redis and the local blobs"
    )
    cache: Path = Field(
        _DIRS.user_cache_path, description="folder of unpacked scenes and compiled kernels"
    )
    url: str = Field(
        "http://127.0.0.1:8713", description="the service that the client commands talk to"
    )
    heartbeat_s: float = Field(5.0, gt=0, description="a worker renews its leases this often")
    lease_s: float = Field(
        15.0, gt=0, description="a lease not renewed for this long may be reclaimed"
    )
    pass_timeout_s: float = Field(
        120.0, gt=0, description="a pass that takes longer is killed with its process group"
    )
    load_timeout_s: float = Field(
        300.0, gt=0, description="a scene that takes longer to load is given up"
    )
    child_memory_gb: float | None = Field(
        None, gt=0, description="memory limit of a render child; unset, its share of the machine's"
    )
    max_upload_gb: float = Field(2.0, gt=0, description="largest scene that the API takes")
    threads: int | None = Field(
        None, gt=0, description="threads of a render child; unset, all cores of the machine"
    )
    keep_results_days: float | None = Field(
        None,
        ge=0,
        allow_inf_nan=False,
        description="finished jobs go after so many days; unset, they stay",
    )
    keep_scenes_days: float | None = Field(
        None,
        ge=0,
        allow_inf_nan=False,
        description="scenes of no job go after so many days without use; unset, they stay",
    )
    log_format: LogFormat = Field(
        "text", description="how processes log: text, or json, an object for each line"
    )
