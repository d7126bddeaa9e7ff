"""Calls about the farm itself, and about the messages that it sends to webhooks."""

from plateau.client.transport import Calls
from plateau.farm.model.deliveries import Delivery
from plateau.farm.model.job import RefusedProcess, Worker
from plateau.farm.wire.views import Scenes, SceneView, Workers
from plateau.farm.wire.webhook_views import Deliveries


class FarmCalls(Calls):
    """Who works, and what is stored."""

    def workers(self) -> list[Worker]:
        """The workers that live, and what each renders."""
        return self._transport.read(Workers, "/v1/workers").workers

    def refused(self) -> list[RefusedProcess]:
        """The processes whose version does not fit the farm's: of each machine the last one."""
        return self._transport.read(Workers, "/v1/workers").refused

    def scenes(self) -> list[SceneView]:
        """The stored scenes; `Client.submit` takes one by its SHA-256."""
        return self._transport.read(Scenes, "/v1/scenes").scenes


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
