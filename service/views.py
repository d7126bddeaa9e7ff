"""What the API shows, as pydantic models that the client shares."""

from pydantic import BaseModel, ConfigDict, Field

from farm.job import CurvePoint, Event, Job, LogEntry, Worker


class JobView(Job):
    """A job with the paths of what belongs to it."""

    # A client may be older than the service that it talks to.
    model_config = ConfigDict(frozen=True, extra="ignore")

    links: dict[str, str] = Field(description="paths of the job's curve, events and images")


class JobPage(BaseModel):
    """A page of jobs, newest first."""

    jobs: list[JobView]
    next_cursor: str | None = Field(
        description="`cursor` of the next page; null when this is the last"
    )


class Curve(BaseModel):
    """The curve of a job."""

    points: list[CurvePoint] = Field(description="by rising spp")


class Happened(BaseModel):
    """What has happened to a job so far."""

    events: list[Event] = Field(description="in their order")


class SliceView(BaseModel):
    """A slice's line in the ledger."""

    model_config = ConfigDict(extra="ignore")

    index: int
    spp: int
    first_seed: int
    last_seed: int
    sha256: str = Field(description="of the partial's bytes")
    worker: str
    render_s: float


class Slices(BaseModel):
    """The ledger of a job."""

    slices: list[SliceView] = Field(description="the committed slices, by index")


class Log(BaseModel):
    """The log of a job."""

    entries: list[LogEntry] = Field(description="how each try of a slice ended, by time")


class SliceLog(BaseModel):
    """The log of a slice."""

    slice: SliceView | None = Field(description="its line in the ledger; null till it has one")
    entries: list[LogEntry] = Field(description="how each try of it ended, by time")


class Workers(BaseModel):
    """The workers that live."""

    workers: list[Worker]


class SceneView(BaseModel):
    """A stored scene."""

    model_config = ConfigDict(extra="ignore")

    sha256: str = Field(description="of the uploaded file; `scene_sha256` of a new job")
    name: str
    bytes: int = Field(description="size of the uploaded file")
    width: int | None = Field(None, description="film width in pixels, as first submitted")
    height: int | None = Field(None, description="film height in pixels, as first submitted")


class Scenes(BaseModel):
    """The stored scenes."""

    scenes: list[SceneView]


class ProblemTypeView(BaseModel):
    """What a problem's type means."""

    type: str
    status: int
    title: str


class Health(BaseModel):
    """The service's health."""

    status: str = "ok"


def job_view(job: Job) -> JobView:
    """The job as the API shows it."""
    root = f"/v1/jobs/{job.id}"
    links = {
        "self": root,
        "curve": f"{root}/curve",
        "events": f"{root}/events",
        "slices": f"{root}/slices",
        "log": f"{root}/log",
        "image_png": f"{root}/image.png",
        "image_exr": f"{root}/image.exr",
        "difference_png": f"{root}/difference.png",
        "cancel": f"{root}/cancel",
    }
    return JobView(**job.model_dump(), links=links)
