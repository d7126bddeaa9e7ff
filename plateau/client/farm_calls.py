"""Calls about the workers and the stored scenes."""

from datetime import date, datetime
from urllib.parse import quote

from plateau.client.transport import Calls
from plateau.farm.model.usage import Grouping
from plateau.farm.model.worker import Worker
from plateau.farm.wire.usage_views import Usage
from plateau.farm.wire.views import Scenes, SceneView, TargetNames, Workers


def _text(time: date | str | None) -> str | None:
    """A time as the service reads it; a `datetime` is a `date`, too."""
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
        asked = {"by": by, "since": _text(since), "until": _text(until), "limit": limit}
        params = {name: str(value) for name, value in asked.items() if value is not None}
        return self._transport.read(Usage, "/v1/usage", params=params)

    def scenes(self) -> list[SceneView]:
        """The stored scenes; `Client.submit` takes one by its SHA-256."""
        return self._transport.read(Scenes, "/v1/scenes").scenes

    def targets(self) -> TargetNames:
        """The targets that a job's notice may name."""
        return self._transport.read(TargetNames, "/v1/targets")
