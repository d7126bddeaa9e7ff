"""The messages of webhooks, and the API's views of them."""

from datetime import datetime

from pydantic import BaseModel, ConfigDict, Field

from plateau.farm.model.deliveries import Delivery
from plateau.farm.model.job import Job
from plateau.farm.model.spec.webhook import WebhookEvent
from plateau.farm.wire import examples
from plateau.farm.wire.views import JobView, job_view


class WebhookData(BaseModel):
    """The data of a webhook's message."""

    model_config = ConfigDict(extra="ignore")

    sequence: int = Field(
        description="1, 2, 3, …: of two messages of a job the one with the greater number tells of "
        "what happened later, whichever came first"
    )
    job: JobView = Field(description="the job as it was when that happened")


class WebhookMessage(BaseModel):
    """The body of a webhook's request."""

    # A receiver may be older than the farm.
    model_config = ConfigDict(
        extra="ignore", json_schema_extra={"examples": [examples.WEBHOOK_MESSAGE]}
    )

    type: str = Field(description="`job.` and the event, as in `job.converged`")
    timestamp: datetime = Field(description="when it happened, by the farm's clock")
    data: WebhookData


class Deliveries(BaseModel):
    """The webhook of a job, and what became of its messages."""

    model_config = ConfigDict(extra="ignore", json_schema_extra={"examples": [examples.DELIVERIES]})

    url: str | None = Field(description="where messages go; null where the job has no webhook")
    events: tuple[WebhookEvent, ...] = Field(description="the message")
    deliveries: tuple[Delivery, ...] = Field(description="by number: the newest hundred")


def message(job: Job, event: WebhookEvent, number: int, at: datetime) -> WebhookMessage:
    """The message about an event of a job, given as it was then; `number` counts from 1."""
    data = WebhookData(sequence=number, job=job_view(job))
    return WebhookMessage(type=f"job.{event}", timestamp=at, data=data)
