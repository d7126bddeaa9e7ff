"""The message that is POSTed to the URL of a job's notice."""

from datetime import datetime

from pydantic import BaseModel, ConfigDict, Field

from plateau.farm.model.job import Job
from plateau.farm.wire import examples
from plateau.farm.wire.views import JobView, job_view


class NoticeData(BaseModel):
    """The data of a notice's message."""

    model_config = ConfigDict(extra="ignore")

    job: JobView = Field(description="the job that has ended, without what became of its notices")


class NoticeMessage(BaseModel):
    """The body of a notice's request."""

    # A receiver may be older than the farm.
    model_config = ConfigDict(
        extra="ignore", json_schema_extra={"examples": [examples.NOTICE_MESSAGE]}
    )

    type: str = Field(description="`job.finished`")
    timestamp: datetime = Field(description="when that was, by the farm's clock")
    data: NoticeData


def message(job: Job) -> NoticeMessage:
    """The message that a job has ended and its results are written; the same at each try."""
    assert job.finished_at is not None
    view = job_view(job.model_copy(update={"notices": ()}))
    return NoticeMessage(type="job.finished", timestamp=job.finished_at, data=NoticeData(job=view))
