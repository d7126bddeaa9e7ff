"""Messages to webhooks as users see them, with their tries."""

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from plateau.farm.model.spec.webhook import WebhookEvent

DeliveryState = Literal["waiting", "trying", "delivered", "given-up"]


class DeliveryTry(BaseModel):
    """How one try of a delivery ended."""

    model_config = ConfigDict(frozen=True)

    at: datetime = Field(description="when it ended")
    status: int | None = Field(description="the receiver's HTTP status, where there was one")
    error: str | None = Field(description="why it is not delivered, where it is not")
    ms: int | None = Field(description="milliseconds that it took, where that is known")


class Delivery(BaseModel):
    """A message to a webhook or a target of notifications, and what became of it."""

    model_config = ConfigDict(frozen=True)

    number: int = Field(description="of the job's messages, from 1, in the order of what happened")
    id: str = Field(description="its `webhook-id`")
    event: WebhookEvent
    target: str | None = Field(
        default=None, description="who is notified; null where it is for a webhook"
    )
    at: datetime = Field(description="when it happened")
    state: DeliveryState = Field(
        description="waiting for its next try, being tried, delivered (the receiver answered 2xx), "
        "or given up (after a day, or since the receiver answered 410)"
    )
    next_try_at: datetime | None = Field(description="when it is tried next, where it is waiting")
    tries: tuple[DeliveryTry, ...] = Field(description="by time, the newest")
