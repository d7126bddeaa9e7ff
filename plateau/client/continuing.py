"""Calls that continue an ended job, or try it again."""

import secrets
from typing import Any

from plateau.client.transport import Calls
from plateau.farm.wire.views import JobView


class ContinuingCalls(Calls):
    """Continuing ended jobs, with more samples or another judgement, and trying them again."""

    def continue_job(
        self, job_id: str, changes: dict[str, Any] | None = None, *, idempotency_key: str = ""
    ) -> JobView:
        """Continue the ended job; returns the new job, which takes over its samples.

        Parameters
        ----------
        job_id
            The ended job, which does not change.
        changes
            Changed fields of the spec, such as ``{"rule": {"target": 0.0001}}`` or
            ``{"max_spp": 20_000}``: a JSON merge patch, except that a rule with a name replaces the
            old one whole.
        idempotency_key
            As for `Client.submit`.

        Raises
        ------
        ApiError
            ``unknown-job``, ``invalid-spec``; ``cannot-continue`` if the job has not ended, its
            samples are gone, or they do not fit the changes, such as some caps on scalar_rgb.
        """
        return self._new_job(f"/v1/jobs/{job_id}/continue", changes, idempotency_key)

    def rejudge(
        self, job_id: str, changes: dict[str, Any] | None = None, *, idempotency_key: str = ""
    ) -> JobView:
        """Judge the kept slices of the ended job again; returns the new job, which renders nothing.

        Parameters
        ----------
        job_id
            An ended job whose spec said ``keep_slices``.
        changes
            Changed fields, of ``view``, ``rule``, ``watch``, ``step`` and ``zones``; see
            `continue_job`.
        idempotency_key
            As for `Client.submit`.

        Raises
        ------
        ApiError
            ``unknown-job``, ``invalid-spec``; ``cannot-continue`` if no slices were kept.
        """
        return self._new_job(f"/v1/jobs/{job_id}/rejudge", changes, idempotency_key)

    def retry(self, job_id: str, *, idempotency_key: str = "") -> JobView:
        """Try the ended job again on other workers; returns the new job.

        It has the same scene and spec, without the webhook. The workers on which tries of the old
        one failed are blocked for it.

        Raises
        ------
        ApiError
            ``unknown-job``; ``job-not-ended``; ``too-many-needs``.
        """
        return self._new_job(f"/v1/jobs/{job_id}/retry", None, idempotency_key)

    def _new_job(self, path: str, changes: dict[str, Any] | None, key: str) -> JobView:
        headers = {"Idempotency-Key": key or secrets.token_hex(16)}
        return self._transport.ask(JobView, "POST", path, headers=headers, json=changes or {})
