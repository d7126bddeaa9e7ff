"""Workers as they describe themselves."""

from datetime import datetime

from pydantic import Field

from plateau.farm.model.place_names import DEFAULT_POOL
from plateau.farm.model.record import Record


class Machine(Record):
    """The machine of a worker, which other processes may use too."""

    cores: int = Field(description="logical ones")
    load: float = Field(
        description="how much of their time was used since the heartbeat before, in [0, 1]"
    )
    memory_bytes: int
    memory_used_bytes: int = Field(description="what no process could be given")
    disk_bytes: int | None = Field(None, description="of the disk that has the worker's cache")
    disk_free_bytes: int | None = Field(None, description="there, after the worker's last slice")
    temperature_c: float | None = Field(
        None,
        description="of its processor after the worker's last slice; null where the system does "
        "not tell",
    )


class Worker(Record):
    """A worker as its last heartbeat described it."""

    id: str
    host: str
    pid: int
    plateau: str | None = Field(None, description="its version")
    variants: tuple[str, ...] = Field(description="what it can render with, best first")
    threads: int
    pool: str = Field(DEFAULT_POOL, description="it renders the jobs of this pool alone")
    tags: tuple[str, ...] = Field((), description="what jobs may require of it")
    job: str | None = Field(description="the job it renders, if any")
    slice: int | None
    slices_done: int
    samples_per_s: float | None = Field(description="rate over its last slice")
    last_error: str | None = Field(
        description="what went wrong last; null once it has rendered a slice since"
    )
    failures: int = Field(0, description="how often something went wrong since then")
    trouble: str | None = Field(
        None,
        description="why it takes no work, as it found that it can render nothing; or that its "
        "render child is stuck",
    )
    label: str | None = Field(
        None, description="its name in the system that started it, such as slurm:1234_5"
    )
    drained: bool = Field(
        False, description="it takes no more slices, and finishes the one that it has"
    )
    left_out_of: tuple[str, ...] = Field(
        (),
        description="jobs of which it gets no slice for two minutes, by their ids: a slice of them "
        "died on it, or it does not see the scene's files as they were submitted",
    )
    core_hours: float | None = Field(
        None,
        description="what the slices cost that it has rendered since its start: their time, times "
        "its threads",
    )
    kinds: tuple[str, ...] = Field(
        (),
        description="what its bits depend on, for each variant that it has tried: renderer, "
        "library, processor, and the bits of a known image",
    )
    machine: Machine | None = None
    started_at: datetime
    seen_at: datetime
