"""Calls about the workers, the stored scenes and the messages to webhooks."""

from plateau.client.transport import Calls
from plateau.farm.model.deliveries import Delivery
from plateau.farm.model.job import RefusedProcess, Worker
from plateau.farm.wire.views import Scenes, SceneView, Workers
from plateau.farm.wire.webhook_views import Deliveries


class FarmCalls(Calls):
    """Workers and stored scenes."""

    def workers(self) -> list[Worker]:
        """The living workers, and what each renders."""
        return self._transport.read(Workers, "/v1/workers").workers

    def refused(self) -> list[RefusedProcess]:
        """The last process of each machine that was refused for its version."""
        return self._transport.read(Workers, "/v1/workers").refused

    def scenes(self) -> list[SceneView]:
        """The stored scenes; `Client.submit` takes one by its SHA-256."""
        return self._transport.read(Scenes, "/v1/scenes").scenes


class WebhookCalls(Calls):
    """The messages to webhooks."""

    def webhooks(self, job_id: str) -> Deliveries:
        """The job's webhook and the messages to it, each with its tries and the next one's time."""
        return self._transport.read(Deliveries, f"/v1/jobs/{job_id}/webhooks")

    def redeliver(self, job_id: str, number: int) -> Delivery:
        """Send a message again now, with the same id; repeated calls send it once.

        Raises
        ------
        ApiError
            ``unknown-job``; ``unknown-delivery`` if the job has no message of this number.
        """
        path = f"/v1/jobs/{job_id}/webhooks/{number}/redeliver"
        return self._transport.ask(Delivery, "POST", path)
