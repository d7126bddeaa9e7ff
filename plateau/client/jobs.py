"""Calls that submit, show, list and steer jobs."""

import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from plateau.client.transport import Calls
from plateau.farm.model.job import LogEntry
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.wire.views import JobPage, JobView, Log, SliceLog, Slices, SliceView
from plateau.files.packing import pack

#: As many as the service puts on one page.
_LARGEST_PAGE: Final = 200


class JobCalls(Calls):
    """Jobs: submitted, shown, listed, steered."""

    def submit(
        self, scene: Path | str, spec: JobSpec | None = None, *, idempotency_key: str | None = None
    ) -> JobView:
        """Submit a scene; returns the new job.

        Parameters
        ----------
        scene
            An XML, a zip, a folder with ``scene.xml``; or the SHA-256 of a stored scene.
        spec
            How it is sampled, judged and stopped.
        idempotency_key
            A request with a key that was used already returns the job that it made then. Unset,
            one is made up, so that a repeated attempt of this call makes one job.

        Raises
        ------
        plateau.farm.bundle.BundleError
            The scene's files cannot be packed: one is missing, or not allowed.
        ApiError
            ``broken-scene``, ``unknown-scene``, ``upload-too-large``, ``idempotency-key-reused``.
        """
        spec = spec or JobSpec()
        headers = {"Idempotency-Key": idempotency_key or secrets.token_hex(16)}
        parts: dict[str, Any] = {"spec": (None, spec.as_request())}
        if isinstance(scene, str):
            parts["scene_sha256"] = (None, scene)
            return self._submitted(headers, parts)
        with pack(scene, spec.parameter_strings()) as packed:
            name = f"{scene.resolve().name}.zip" if scene.is_dir() else packed.name
            parts["scene"] = (name, packed.file, packed.media_type)  # httpx rewinds it each time
            return self._submitted(headers, parts)

    def job(self, job_id: str) -> JobView:
        """The job as it stands.

        Raises
        ------
        ApiError
            ``unknown-job``.
        """
        return self._transport.read(JobView, f"/v1/jobs/{job_id}")

    def jobs(
        self,
        *,
        state: JobState | None = None,
        batch: str | None = None,
        owner: str | None = None,
        cursor: str | None = None,
        limit: int = 50,
    ) -> JobPage:
        """A page of jobs, newest first; `all_jobs` turns the pages by itself.

        Parameters
        ----------
        state, batch, owner
            Only jobs in this state, of this batch, or of this API key, by its id.
        cursor
            `next_cursor` of the page before.
        limit
            Most jobs on the page, 1 to 200.

        Raises
        ------
        ApiError
            ``invalid-request``.
        """
        asked = {
            "state": state and state.value,
            "batch": batch,
            "owner": owner,
            "cursor": cursor,
            "limit": limit,
        }
        params = {name: value for name, value in asked.items() if value is not None}
        return self._transport.read(JobPage, "/v1/jobs", params=params)

    def all_jobs(
        self,
        *,
        state: JobState | None = None,
        batch: str | None = None,
        owner: str | None = None,
    ) -> Iterator[JobView]:
        """Every job, newest first; pages are fetched as they are needed.

        Jobs that are submitted meanwhile are not among them.
        """
        cursor = None
        while True:
            page = self.jobs(
                state=state, batch=batch, owner=owner, cursor=cursor, limit=_LARGEST_PAGE
            )
            yield from page.jobs
            cursor = page.next_cursor
            if cursor is None:
                return

    def cancel(self, job_id: str) -> JobView:
        """Cancel the job; what is merged by then is kept. Cancelling it again is harmless.

        Raises
        ------
        ApiError
            ``unknown-job``; ``cannot-cancel`` where it has ended otherwise.
        """
        return self._steer(job_id, "cancel")

    def pause(self, job_id: str) -> JobView:
        """Pause the rendering job: slices in hand are finished, no more are taken.

        It may still converge by those slices; pausing it again is harmless.

        Raises
        ------
        ApiError
            ``unknown-job``; ``cannot-pause`` where it is not rendering.
        """
        return self._steer(job_id, "pause")

    def resume(self, job_id: str) -> JobView:
        """Let the paused job go on; resuming it again is harmless.

        Raises
        ------
        ApiError
            ``unknown-job``; ``cannot-resume`` where it is not paused.
        """
        return self._steer(job_id, "resume")

    def set_priority(self, job_id: str, priority: int) -> JobView:
        """Give the job another priority, -1000 to 1000: higher is served first.

        Raises
        ------
        ApiError
            ``unknown-job``, ``invalid-request``; ``job-ended`` where nothing can be changed.
        """
        change = {"priority": priority}
        answer = self._transport.send("PATCH", f"/v1/jobs/{job_id}", json=change)
        return self._transport.understood(JobView, answer)

    def slices(self, job_id: str) -> list[SliceView]:
        """The job's ledger: each committed slice, by index.

        Raises
        ------
        ApiError
            ``unknown-job``.
        """
        return self._transport.read(Slices, f"/v1/jobs/{job_id}/slices").slices

    def log(self, job_id: str) -> list[LogEntry]:
        """How each try of a slice of the job ended, by time.

        Raises
        ------
        ApiError
            ``unknown-job``.
        """
        return self._transport.read(Log, f"/v1/jobs/{job_id}/log").entries

    def slice_log(self, job_id: str, index: int) -> SliceLog:
        """The same of one slice, with its line in the ledger.

        Raises
        ------
        ApiError
            ``unknown-job``; ``unknown-slice`` where the job can never have it.
        """
        return self._transport.read(SliceLog, f"/v1/jobs/{job_id}/slices/{index}/log")

    def _submitted(self, headers: dict[str, str], parts: dict[str, Any]) -> JobView:
        answer = self._transport.send("POST", "/v1/jobs", headers=headers, files=parts)
        return self._transport.understood(JobView, answer)

    def _steer(self, job_id: str, what: str) -> JobView:
        answer = self._transport.send("POST", f"/v1/jobs/{job_id}/{what}")
        return self._transport.understood(JobView, answer)
