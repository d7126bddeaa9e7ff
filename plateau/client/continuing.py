"""Calls that go on with a job that has ended."""

import secrets
from typing import Any

from plateau.client.transport import Calls
from plateau.farm.wire.views import JobView


class ContinuingCalls(Calls):
    """Ended jobs, gone on with: to more samples, or under another judgement."""

    def continue_job(
        self, job_id: str, changes: dict[str, Any] | None = None, *, idempotency_key: str = ""
    ) -> JobView:
        """Go on with the ended job; returns the new one, which takes over its samples.

        Parameters
        ----------
        job_id
            The ended job, which stays as it is.
        changes
            Fields of the spec that are to be others, such as ``{"rule": {"target": 0.0001}}`` or
            ``{"max_spp": 20_000}``: a JSON merge patch, but that a rule with a name replaces the
            old one whole.
        idempotency_key
            As for `Client.submit`.

        Raises
        ------
        ApiError
            ``unknown-job``, ``invalid-spec``; ``cannot-continue`` where the job has not ended, its
            samples are gone, or they do not suit what is asked, as with some caps on scalar_rgb.
        """
        return self._asked(f"/v1/jobs/{job_id}/continue", changes, idempotency_key)

    def rejudge(
        self, job_id: str, changes: dict[str, Any] | None = None, *, idempotency_key: str = ""
    ) -> JobView:
        """Judge the kept slices of the ended job again; returns the new job, which renders nothing.

        Parameters
        ----------
        job_id
            An ended job whose spec said ``keep_slices``.
        changes
            What is to be another: ``view``, ``rule``, ``watch``, ``step``, ``zones``; see
            `continue_job`.
        idempotency_key
            As for `Client.submit`.

        Raises
        ------
        ApiError
            ``unknown-job``, ``invalid-spec``; ``cannot-continue`` where no slices were kept.
        """
        return self._asked(f"/v1/jobs/{job_id}/rejudge", changes, idempotency_key)

    def _asked(self, path: str, changes: dict[str, Any] | None, key: str) -> JobView:
        headers = {"Idempotency-Key": key or secrets.token_hex(16)}
        answer = self._transport.send("POST", path, headers=headers, json=changes or {})
        return self._transport.understood(JobView, answer)
