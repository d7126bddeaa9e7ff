"""Routes for a job's webhook: the deliveries of its messages, and their repetition."""

from typing import Annotated

from fastapi import APIRouter, Path

from plateau.farm.model.deliveries import Delivery
from plateau.farm.wire import examples
from plateau.farm.wire.views import job_view
from plateau.farm.wire.webhook_views import Deliveries, WebhookMessage
from plateau.service.api.access.callers import CallerOf
from plateau.service.api.parts import Farm
from plateau.service.api.problems import problem as problems
from plateau.service.api.problems.problem import Problem, documented
from plateau.service.api.routes.jobs import JobId

router = APIRouter(prefix="/v1/jobs/{job_id}/webhooks", tags=["webhooks"])

#: The requests that the farm itself sends, for the OpenAPI document only.
sent = APIRouter()


@router.get("", responses=documented(problems.UNKNOWN_JOB))
def list_deliveries(job_id: JobId, farm: Farm, who: CallerOf) -> Deliveries:
    """Show what became of the messages to a job's webhook: each try, and when the next one is due.

    The newest hundred messages, and about the newest thousand of their tries.
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
    farm: Farm,
) -> Delivery:
    """Send a message again, now, with the same id and content.

    It may have been delivered or given up, or wait for its next try; it gets the full number of
    tries again. One that is being tried at this moment is left alone.
    """
    job = farm.job(job_id)
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
    response_description="the message is delivered, as by any 2xx",
)
def tell_of_job(_: WebhookMessage) -> None:
    """What happened to a job, sent to its spec's `webhook`.

    Signed by Standard Webhooks: `webhook-id` is the same at every try, `webhook-timestamp` is in
    seconds since 1970, and `webhook-signature` is `v1,` and a base64 HMAC-SHA256 of
    `id.timestamp.body`. A 2xx answer within 15 s delivers the message; 410 ends its tries; after
    any other answer it is tried again for about a day.
    """
