"""Calls that submit, show, list and steer jobs."""

import math
import secrets
from collections.abc import Iterator
from typing import Any, Final

from plateau.client.short_ids import job_or_batch, whole_id, with_whole_ids
from plateau.client.submission import spec_of, submitted
from plateau.client.transport import Calls
from plateau.farm.model.job import LogEntry
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.spec.notice import NoticeSpec
from plateau.farm.model.states import JobState
from plateau.farm.wire.views import JobPage, JobView, Log, Slices, SliceView
from plateau.files.scene_at_hand import SceneAtHand

#: The most that the service puts on one page.
_LARGEST_PAGE: Final = 200


class JobCalls(Calls):
    """Jobs: submitted, shown, listed, steered.

    A call that takes a job's id raises `ApiError` ``unknown-job`` if there is none.
    """

    def submit(
        self,
        /,
        scene: SceneAtHand,
        spec: JobSpec | None = None,
        *,
        idempotency_key: str | None = None,
        **fields: Any,
    ) -> JobView:
        """Submit a scene; returns the new job.

        Parameters
        ----------
        scene
            An XML, a zip, a folder with ``scene.xml``; ``scenes:NAME``, an example; a Mitsuba
            dict; the SHA-256 of a stored scene; or ``{ROOT}/PATH``, in the service's scene roots.
        spec
            How it is sampled, judged and stopped.
        idempotency_key
            A second call with the same key returns the job that the first one made. Without it,
            each call has a new key, and its repeated attempts make one job.
        **fields
            Fields of `JobSpec`, which replace those of `spec`.

        Raises
        ------
        InvalidSpec
            A field of the spec is unknown, or its value is not allowed.
        plateau.farm.bundle.BundleError
            A file of the scene is missing or not allowed, or a value of the dict can't be written.
        ApiError
            ``broken-scene``, ``unknown-scene``, ``upload-too-large``, ``idempotency-key-reused``.
        """
        spec = spec_of(spec, fields)
        spec = with_whole_ids(spec, self._transport.whole_id)
        values, request = [spec.parameter_strings()], spec.as_request()
        return submitted(self._transport, JobView, scene, request, values, idempotency_key)

    def again(self, job_id: str, /, *, idempotency_key: str = "", **changes: Any) -> JobView:
        """Render the ended job again, with a changed spec; returns the new job.

        It has the samples of the old job where they are left and the new spec draws the same;
        `again` of the new job says how many it keeps, or why none. Another ``seed`` draws others.
        The notice, ``after`` and ``shot`` are not inherited.

        Parameters
        ----------
        job_id
            The ended job, which stays as it is.
        idempotency_key
            As for `submit`.
        changes
            Changed fields of the spec, such as ``rule={"target": 0.0001}`` or ``max_spp=20_000``: a
            JSON merge patch, except that a rule with a name, or an object such as a `ViewSpec`,
            replaces the old one whole.

        Raises
        ------
        ApiError
            ``unknown-job``; ``job-not-ended``, also while its results are being written;
            ``invalid-spec``; ``broken-scene``; ``uneven-batch``.
        """
        if after := changes.get("after"):
            changes["after"] = [job_or_batch(one, self._transport.whole_id) for one in after]
        if isinstance(notice := changes.get("notice"), NoticeSpec):
            changes["notice"] = notice.as_request()
        headers = {"Idempotency-Key": idempotency_key or secrets.token_hex(16)}
        path = f"/v1/jobs/{job_id}/again"
        return self._transport.make(JobView, path, headers=headers, json=changes)

    def whole_id(self, job_id: str) -> str:
        """The whole id of a job, by its first letters, at least four; a whole one unchanged.

        Every call takes shortened ids. Programs should store whole ones: another may begin so.

        Raises
        ------
        BadId
            None of the newest 1,000 jobs has such an id, or several have.
        """
        return whole_id(job_id, self.all_jobs(deleted=None))

    def job(self, job_id: str) -> JobView:
        """The current state of the job."""
        return self._transport.read(JobView, f"/v1/jobs/{job_id}")

    def all_jobs(
        self,
        *,
        state: JobState | None = None,
        batch: str | None = None,
        owner: str | None = None,
        search: str | None = None,
        deleted: bool | None = False,
        limit: int | None = None,
    ) -> Iterator[JobView]:
        """Every such job, newest first; pages are fetched as they are needed.

        Jobs submitted in the meantime are left out.

        Parameters
        ----------
        state, batch, owner
            Only jobs in this state, of this batch, or of the API key with this id.
        search
            Only jobs in which each of these words occurs: in the id, the name, the batch, the
            owner's name or a required tag.
        deleted
            Whether only deleted jobs, or only others; None for both.
        limit
            Most jobs; None for all of them.

        Raises
        ------
        ApiError
            ``invalid-request``.
        """
        asked = {
            "state": state and state.value,
            "batch": batch,
            "owner": owner,
            "search": search,
            # As the service reads it; its own default is left out.
            "deleted": {False: None, True: "true", None: "any"}[deleted],
        }
        params: dict[str, Any] = {name: one for name, one in asked.items() if one is not None}
        left = math.inf if limit is None else limit
        while left > 0:
            params["limit"] = min(left, _LARGEST_PAGE)
            page = self._transport.read(JobPage, "/v1/jobs", params=params)
            yield from page.jobs
            left -= len(page.jobs)
            if page.next_cursor is None:
                return
            params["cursor"] = page.next_cursor

    def cancel(self, job_id: str) -> JobView:
        """Cancel the job; the image merged so far is kept. Cancelling it again is harmless.

        Raises
        ------
        ApiError
            ``unknown-job``; ``cannot-cancel`` if it has ended in another state.
        """
        return self._steer(job_id, "cancel")

    def pause(self, job_id: str) -> JobView:
        """Pause the rendering job: workers finish their slices and take no more.

        It may still converge with those slices. Pausing it again is harmless.

        Raises
        ------
        ApiError
            ``unknown-job``; ``cannot-pause`` if it is not rendering.
        """
        return self._steer(job_id, "pause")

    def resume(self, job_id: str) -> JobView:
        """Resume the paused job; resuming it again is harmless.

        Raises
        ------
        ApiError
            ``unknown-job``; ``cannot-resume`` if it is not paused.
        """
        return self._steer(job_id, "resume")

    def delete(self, job_id: str) -> JobView:
        """Delete the ended job; `restore` undoes that until a sweep has removed it.

        It leaves lists and its batch at once. Deleting it again is harmless.

        Raises
        ------
        ApiError
            ``unknown-job``; ``job-not-ended``.
        """
        return self._transport.ask(JobView, "DELETE", f"/v1/jobs/{job_id}")

    def restore(self, job_id: str) -> JobView:
        """Put the deleted job back into the list; harmless to repeat. Raises as `delete` does."""
        return self._steer(job_id, "restore")

    def set_priority(self, job_id: str, priority: int) -> JobView:
        """Give the job another priority, -1000 to 1000; a higher one is rendered first.

        Raises
        ------
        ApiError
            ``unknown-job``, ``invalid-request``; ``job-ended`` if the job has ended.
        """
        change = {"priority": priority}
        return self._transport.ask(JobView, "PATCH", f"/v1/jobs/{job_id}", json=change)

    def slices(self, job_id: str) -> list[SliceView]:
        """The job's ledger: each committed slice, by index."""
        return self._transport.read(Slices, f"/v1/jobs/{job_id}/slices").slices

    def log(self, job_id: str, *, index: int | None = None) -> list[LogEntry]:
        """How each try of a slice of the job ended, or of that with this index, by time.

        Raises
        ------
        ApiError
            ``unknown-job``; ``unknown-slice`` if the index is beyond the job's cap.
        """
        only = "" if index is None else f"?slice={index}"
        return self._transport.read(Log, f"/v1/jobs/{job_id}/log{only}").entries

    def _steer(self, job_id: str, action: str) -> JobView:
        return self._transport.ask(JobView, "POST", f"/v1/jobs/{job_id}/{action}")
