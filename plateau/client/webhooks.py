"""Calls about the messages to a job's webhook."""

from plateau.client.calls import Calls
from plateau.farm.model.deliveries import Delivery
from plateau.farm.wire.webhook_views import Deliveries


class WebhookCalls(Calls):
    """What became of the messages to webhooks."""

    def webhooks(self, job_id: str) -> Deliveries:
        """The job's webhook and the messages to it, each with its tries and when the next is.

        Raises
        ------
        ApiError
            ``unknown-job``.
        """
        return self._transport.read(Deliveries, f"/v1/jobs/{job_id}/webhooks")

    def redeliver(self, job_id: str, number: int) -> Delivery:
        """Send a message again, now, under the id that it had; a repeat sends it no more often.

        Raises
        ------
        ApiError
            ``unknown-job``; ``unknown-delivery`` where the job has none of this number.
        """
        answer = self._transport.send("POST", f"/v1/jobs/{job_id}/webhooks/{number}/redeliver")
        return self._transport.understood(Delivery, answer)
