"""Calls about the workers, the stored scenes and the messages to webhooks."""

from datetime import date, datetime
from urllib.parse import quote

from plateau.client.transport import Calls
from plateau.farm.model.deliveries import Delivery
from plateau.farm.model.usage import Grouping
from plateau.farm.model.worker import RefusedProcess, Worker
from plateau.farm.wire.usage_views import Usage
from plateau.farm.wire.views import AtTheEnd, Scenes, SceneView, Workers
from plateau.farm.wire.webhook_views import Deliveries


def _asked(
    by: str, since: date | str | None, until: date | str | None, limit: int | None
) -> dict[str, str]:
    """The parameters; a `datetime` is a `date`, too."""
    asked = {"by": by, "since": _text(since), "until": _text(until), "limit": limit}
    return {name: str(value) for name, value in asked.items() if value is not None}


def _text(time: date | str | None) -> str | None:
    if isinstance(time, datetime):
        return time.isoformat(timespec="seconds")
    return time.isoformat() if isinstance(time, date) else time


class FarmCalls(Calls):
    """Workers and stored scenes."""

    def workers(self) -> list[Worker]:
        """The living workers, and what each renders."""
        return self._transport.read(Workers, "/v1/workers").workers

    def drain(self, worker_id: str) -> Worker:
        """Let the worker finish its slice and take no more; repeating it is harmless.

        Raises
        ------
        ApiError
            ``unknown-worker``; ``role-too-low`` unless the key is an admin's.
        """
        return self._steer_worker(worker_id, "drain")

    def undrain(self, worker_id: str) -> Worker:
        """Let the drained worker take slices again; raises as `drain` does."""
        return self._steer_worker(worker_id, "resume")

    def _steer_worker(self, worker_id: str, action: str) -> Worker:
        path = f"/v1/workers/{quote(worker_id, safe='')}/{action}"
        workers = self._transport.ask(Workers, "POST", path).workers
        return next(worker for worker in workers if worker.id == worker_id)

    def refused(self) -> list[RefusedProcess]:
        """The last process of each machine that was refused for its version."""
        return self._transport.read(Workers, "/v1/workers").refused

    def usage(
        self,
        by: Grouping = "week",
        *,
        since: date | str | None = None,
        until: date | str | None = None,
        limit: int | None = None,
    ) -> Usage:
        """What the jobs that were submitted from `since` on and before `until` have cost.

        Raises
        ------
        ApiError
            ``invalid-request``, for example where `until` is not later than `since`.
        """
        return self._transport.read(Usage, "/v1/usage", params=_asked(by, since, until, limit))

    def usage_csv(
        self,
        by: Grouping = "week",
        *,
        since: date | str | None = None,
        until: date | str | None = None,
        limit: int | None = None,
    ) -> str:
        """The same as CSV."""
        asked = _asked(by, since, until, limit)
        return self._transport.send(
            "GET", "/v1/usage", params=asked, headers={"Accept": "text/csv"}
        ).text

    def scenes(self) -> list[SceneView]:
        """The stored scenes; `Client.submit` takes one by its SHA-256."""
        return self._transport.read(Scenes, "/v1/scenes").scenes

    def targets(self) -> AtTheEnd:
        """The targets of notifications, and the commands, that a spec may name."""
        return self._transport.read(AtTheEnd, "/v1/targets")


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
