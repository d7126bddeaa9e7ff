"""Routes for a job's webhook: what became of its messages, and to send one again."""

from typing import Annotated

from fastapi import APIRouter, Depends, Path

from plateau.farm.model.deliveries import Delivery
from plateau.farm.model.job import Job
from plateau.farm.wire import examples
from plateau.farm.wire.views import job_view
from plateau.farm.wire.webhook_views import Deliveries, WebhookMessage
from plateau.service.api.access.callers import CallerOf
from plateau.service.api.parts import Parts, parts
from plateau.service.api.problems import problem as problems
from plateau.service.api.problems.problem import Problem, documented
from plateau.service.api.routes.jobs import JobId

router = APIRouter(prefix="/v1/jobs/{job_id}/webhooks", tags=["webhooks"])

#: What the farm sends, for the API's description alone.
sent = APIRouter()


@router.get("", responses=documented(problems.UNKNOWN_JOB))
def list_deliveries(
    job_id: JobId, farm: Annotated[Parts, Depends(parts)], who: CallerOf
) -> Deliveries:
    """Show what became of the messages to a job's webhook: each try of each, and when the next is.

    The newest hundred messages, and of their tries the newest thousand or so.
    """
    job = farm.job(job_id)
    webhook = job_view(job, to_owner=who.made(job.owner)).spec.webhook
    return Deliveries(
        url=None if webhook is None else webhook.url,
        events=() if webhook is None else webhook.events,
        deliveries=tuple(farm.outbox.deliveries(job.id)),
    )


@router.post(
    "/{number}/redeliver",
    status_code=202,
    responses={
        202: {"content": {"application/json": {"example": examples.DELIVERY}}},
        **documented(problems.UNKNOWN_JOB, problems.UNKNOWN_DELIVERY, problems.INVALID_REQUEST),
    },
)
def redeliver_message(
    job_id: JobId,
    number: Annotated[
        int, Path(ge=1, le=10**9, description="the delivery's `number`", examples=[2])
    ],
    farm: Annotated[Parts, Depends(parts)],
) -> Delivery:
    """Send a message again, now, with the id and the content that it had.

    Whether it was delivered, given up, or waits for its next try; it has all its tries before it
    then. One that is being tried at this moment is left alone.
    """
    job: Job = farm.job(job_id)
    found = farm.outbox.redeliver(job.id, number)
    if found is None:
        raise Problem(
            problems.UNKNOWN_DELIVERY,
            f"job {job.id} has no delivery {number}; GET /v1/jobs/{job.id}/webhooks lists those "
            "it has",
        )
    return found


@sent.post(
    "job",
    operation_id="tell_of_job",
    status_code=204,
    response_description="it is delivered, as by any 2xx",
)
def tell_of_job(_: WebhookMessage) -> None:
    """What happened to a job, sent to its spec's `webhook`.

    Signed as Standard Webhooks has it: `webhook-id` is the same at every try, `webhook-timestamp`
    is in seconds since 1970, and `webhook-signature` is `v1,` and a base64 HMAC-SHA256 of
    `id.timestamp.body`. Any 2xx answer within 15 s is a delivery; 410 ends it; anything else is
    tried again for about a day.
    """
