"""The API's answers as pydantic models, which the client shares."""

from typing import Any, Final

from pydantic import BaseModel, ConfigDict, Field
from pydantic.config import JsonDict

from plateau.farm.model.job import CurvePoint, Event, Job, LogEntry, utc_now
from plateau.farm.model.spec import Priority
from plateau.farm.model.states import JobState
from plateau.farm.model.worker import Worker
from plateau.farm.process.letters import on_one_line
from plateau.farm.wire import examples
from plateau.farm.wire.figures import roughly
from plateau.farm.wire.json_numbers import WithWholeNumbers

#: Below so many seconds, what is expected comes any moment.
_SOON_S: Final = 3
#: The paths below a job's.
_PARTS: Final = (
    *("curve", "events", "slices", "log", "image.png", "image.exr"),
    *("difference.png", "noise.png", "quality.png", "spp.png", "non-finite.png"),
    *("thumbnail.png", "previews", "results.zip"),
    *("cancel", "pause", "resume", "restore", "again"),
)


def _shows(example: dict[str, Any]) -> JsonDict:
    """The part of a schema with this example."""
    return {"examples": [example]}


class JobView(Job):
    """A job with the paths of what belongs to it."""

    # A client may be older than the service that it talks to.
    model_config = ConfigDict(frozen=True, extra="ignore", json_schema_extra=_shows(examples.JOB))

    title: str = Field(description="its name, and the values for its scene's parameters")
    waits_for: str | None = Field(
        None,
        description="in words, the jobs and batches that it comes after, or the kind of worker "
        "that it waits for where none lives that fits",
    )
    queue_place: int | None = Field(
        None,
        description="of a queued job: its place among all queued ones, by priority and then by "
        "age; 1 is next. Null for others, and where it is held back or waits for other jobs",
    )
    time_left: str = Field(
        description="a queued job's place, or the time that one still needs, in words; empty where "
        "it is not known"
    )
    sampled: str = Field(
        description="where its samples go, in words, and why not to zones where `auto` is the frame"
    )
    seen: str = Field(
        description="where the image is judged as seen, in words: `spec.view` for people"
    )
    seen_density: float | None = Field(
        None, description="pixels in a degree there; null before the image's size is known"
    )
    fitting_workers: int | None = Field(
        None,
        description="how many living workers can render it; null for a job that has ended, and in "
        "notices",
    )
    links: dict[str, str] = Field(description="paths of the job's curve, events and images")


class JobChange(WithWholeNumbers):
    """What of a job can be changed while it has not ended."""

    model_config = ConfigDict(
        extra="forbid", strict=True, json_schema_extra=_shows({"priority": 10})
    )

    priority: Priority = Field(
        strict=True,
        description="higher is served first; the next lease of a slice goes by it",
        examples=[5],
    )


class JobPage(BaseModel):
    """A page of jobs, newest first."""

    model_config = ConfigDict(
        json_schema_extra=_shows({"jobs": [examples.JOB], "next_cursor": "42"})
    )

    jobs: list[JobView]
    next_cursor: str | None = Field(
        description="`cursor` of the next page; null when this is the last"
    )


class Curve(BaseModel):
    """The curve of a job."""

    model_config = ConfigDict(json_schema_extra=_shows({"points": [examples.POINT]}))

    points: list[CurvePoint] = Field(description="by rising spp")


class Happened(BaseModel):
    """The events of a job so far."""

    model_config = ConfigDict(json_schema_extra=_shows({"events": [examples.EVENT]}))

    events: list[Event] = Field(description="in their order")


class SliceView(BaseModel):
    """A slice's record in the ledger."""

    model_config = ConfigDict(extra="ignore", json_schema_extra=_shows(examples.SLICE))

    index: int
    spp: int
    first_seed: int
    last_seed: int
    sha256: str = Field(description="of the partial's bytes")
    worker: str
    render_s: float
    zones: list[list[int]] = Field(
        [],
        description="the parts of the film that it has, each as x, y, width and height; none for "
        "the whole film",
    )


class Slices(BaseModel):
    """The ledger of a job."""

    model_config = ConfigDict(json_schema_extra=_shows({"slices": [examples.SLICE]}))

    slices: list[SliceView] = Field(description="the committed slices, by index")


class Log(BaseModel):
    """The log of a job."""

    model_config = ConfigDict(json_schema_extra=_shows({"entries": [examples.LOG_ENTRY]}))

    entries: list[LogEntry] = Field(description="how each try of a slice ended, by time")


class Workers(BaseModel):
    """The workers that live."""

    model_config = ConfigDict(json_schema_extra=_shows({"workers": [examples.WORKER]}))

    workers: list[Worker]


class DemandView(BaseModel):
    """Slices that need a worker."""

    model_config = ConfigDict(json_schema_extra=_shows({"slices": 7, "waiting": 4, "leased": 3}))

    slices: int = Field(description="waiting and leased ones together")
    waiting: int = Field(description="planned and not leased, of jobs that are not paused")
    leased: int = Field(description="leased to a worker")


class SceneView(BaseModel):
    """A stored scene."""

    model_config = ConfigDict(extra="ignore", json_schema_extra=_shows(examples.SCENE))

    sha256: str = Field(description="of the uploaded file; `scene_sha256` of a new job")
    name: str
    bytes: int = Field(description="size of the uploaded file")
    width: int | None = Field(
        None,
        description="film width in pixels, as first submitted; null where the renderer alone can "
        "tell",
    )
    height: int | None = Field(None, description="film height in pixels, likewise")


class Scenes(BaseModel):
    """The stored scenes."""

    model_config = ConfigDict(
        json_schema_extra=_shows(
            {
                "scenes": [examples.SCENE],
                "roots": ["assets"],
                "formats": {".xml": "a Mitsuba XML", ".json": "an analytic scene"},
            }
        )
    )

    scenes: list[SceneView]
    roots: list[str] = Field(
        [], description="the service's scene roots: a scene in one is named `{ROOT}/PATH`"
    )
    formats: dict[str, str] = Field(
        {}, description="what a scene may be, by the suffix of its file; or a zip of one"
    )


class TargetNames(BaseModel):
    """The targets of notices, by the names that the farm's operator gives them."""

    model_config = ConfigDict(json_schema_extra=_shows({"targets": ["lead"], "always": ["ops"]}))

    targets: list[str] = Field(description="which a job's `notice` may name")
    always: list[str] = Field(description="those that are notified of every job")


class SceneFound(SceneView):
    """What the check of a scene found in it."""

    model_config = ConfigDict(json_schema_extra=_shows(examples.SCENE_FOUND))

    kind: str = Field(
        description="what it is: the format of a single file, such as xml or json, or zip"
    )
    entry: str = Field(description="the scene's own file, by its name in the bundle")
    files: int = Field(description="how many files there are")
    bytes_unpacked: int = Field(description="and their size when unpacked")
    sensors: int = Field(description="how many sensors the scene has")
    parameters: dict[str, str] = Field(description="the scene's parameters with their defaults")


class Preview(BaseModel):
    """A preview of a job's course."""

    model_config = ConfigDict(json_schema_extra=_shows(examples.PREVIEW))

    spp: int = Field(description="samples per pixel of the merged image that it shows")
    link: str = Field(description="path of the picture")


class PreviewList(BaseModel):
    """The previews of a job's course."""

    model_config = ConfigDict(json_schema_extra=_shows({"previews": [examples.PREVIEW]}))

    previews: list[Preview] = Field(description="by rising spp; the newest image is not among them")


class ProblemTypeView(BaseModel):
    """What a problem's type means."""

    model_config = ConfigDict(
        json_schema_extra=_shows(
            {"type": "/problems/no-scene", "status": 422, "title": "Missing scene"}
        )
    )

    type: str
    status: int
    title: str


class Health(BaseModel):
    """The service's health."""

    model_config = ConfigDict(json_schema_extra=_shows({"status": "ok"}))

    status: str = "ok"


def job_view(job: Job, *, to_owner: bool = False, **queued: Any) -> JobView:
    """The job as the API shows it.

    Only its owner sees the path of its notice's URL, which is often a secret. `queued` are the
    fields that go by the queue and the workers.
    """
    if job.spec.notice.url is not None and not to_owner:
        spec = job.spec.model_copy(update={"notice": job.spec.notice.hidden()})
        job = job.model_copy(update={"spec": spec})
    root = f"/v1/jobs/{job.id}"
    links = {
        part.removesuffix(".zip").replace(".", "_").replace("-", "_"): f"{root}/{part}"
        for part in _PARTS
    }
    values = (f"{name}={value}" for name, value in job.spec.parameter_strings().items())
    words = {"reason": on_one_line(job.reason), "notes": tuple(map(on_one_line, job.notes))}
    return JobView(
        **{**job.model_dump(), **words},
        **queued,
        title=" ".join((job.name, *values)),
        time_left=_time_left(job, queued.get("queue_place")),
        sampled=_sampled(job),
        seen=job.spec.view.words,
        seen_density=job.spec.view.density(job.width) if job.width else None,
        links={"self": root, **links},
    )


def _sampled(job: Job) -> str:
    if job.spec.by_zones:
        return "by zones"
    why = "" if job.frames_because is None else f" (auto, because of {job.frames_because})"
    return f"all over the frame{why}"


def _time_left(job: Job, queue_place: int | None) -> str:
    if job.state is JobState.QUEUED:
        return "" if queue_place is None else f"place {queue_place:,} in the queue"
    if job.state is not JobState.RENDERING or job.started_at is None:
        return ""
    expected, expected_s = job.expected_spp, job.expected_s
    if expected is not None and expected_s is not None and expected <= job.spec.max_spp:
        # The forecast is as old as the last point; slices were committed since.
        ahead = max(0, expected - job.committed_spp) / max(1, expected - job.spp)
        seconds = ahead * expected_s
        return "any moment" if seconds < _SOON_S else f"about {roughly(seconds)} left"
    rendered = job.committed_spp - (job.again.kept_spp if job.again else 0)
    rendering_s = (utc_now() - job.started_at).total_seconds() - job.paused_s
    if rendered <= 0 or rendering_s <= 0:
        return ""
    to_cap = max(0, job.spec.max_spp - job.committed_spp)
    return f"at most {roughly(to_cap * rendering_s / rendered)} left"
