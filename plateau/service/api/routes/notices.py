"""Who can be told of a job's end, and what is sent to its URL."""

from fastapi import APIRouter

from plateau.farm.wire.notice_views import NoticeMessage
from plateau.farm.wire.views import TargetNames
from plateau.service.api.parts import Farm
from plateau.service.api.problems.catalogue import documented

router = APIRouter(tags=["notices"])

#: The requests that the farm itself sends, for the OpenAPI document only.
sent = APIRouter()


@router.get("/v1/targets", responses=documented())
def list_targets(farm: Farm) -> TargetNames:
    """List the targets of notices that the farm's operator has named."""
    targets = farm.targets
    return TargetNames(
        targets=sorted({*targets.urls} - {*targets.always}), always=sorted(targets.always)
    )


@sent.post(
    "job",
    operation_id="tell_of_job",
    status_code=204,
    response_description="the notice is delivered, as by any 2xx",
)
def tell_of_job(_: NoticeMessage) -> None:
    """A job that has ended and whose results are written, sent to the URL of its spec's `notice`.

    Signed by Standard Webhooks: `webhook-id` is the same at every try, `webhook-timestamp` is in
    seconds since 1970, and `webhook-signature` is `v1,` and a base64 HMAC-SHA256 of
    `id.timestamp.body`. A 2xx answer within 15 s delivers the message; 410 ends its tries; after
    any other answer it is tried again for about a day.
    """
