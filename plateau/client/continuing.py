"""Calls that continue an ended job, or try it again."""

import secrets
from typing import Any, Final

from plateau.client.jobs import submitted
from plateau.client.short_ids import with_whole_ids
from plateau.client.transport import Calls
from plateau.farm.model.spec import JobSpec
from plateau.farm.wire.views import JobView

#: Fields of a spec of which changes leave the rest as it was.
_MERGED: Final = ("view", "exr", "parameters")


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

    def resubmit(
        self, job_id: str, changes: dict[str, Any] | None = None, *, idempotency_key: str = ""
    ) -> JobView:
        """Submit the scene of a job again; returns the new job, which begins with no sample.

        Its spec is that of the old job, without the webhook; it waits for no other job, and is no
        frame of a shot.

        Parameters
        ----------
        job_id
            The job, in any state.
        changes
            Changed fields of the spec, such as ``{"max_spp": 20_000}``. Of a view, of ``exr`` and
            of parameters, those that are not given are as they were; any other replaces the old
            one whole.
        idempotency_key
            As for `Client.submit`.

        Raises
        ------
        ApiError
            ``unknown-job``; ``unknown-scene`` if the scene is not stored any more; and those of
            `Client.submit`.
        pydantic.ValidationError
            A field of the spec is unknown, or its value is not allowed.
        """
        job = self._transport.read(JobView, f"/v1/jobs/{job_id}")
        fields = job.spec.model_dump(mode="json", exclude={"webhook", "after", "shot"})
        for name, value in (changes or {}).items():
            merged = name in _MERGED and isinstance(value, dict)
            fields[name] = {**fields[name], **value} if merged else value
        spec = with_whole_ids(JobSpec.model_validate(fields), self._transport.whole_id)
        values, request = [spec.parameter_strings()], spec.as_request()
        key = idempotency_key or None
        return submitted(self._transport, JobView, job.scene_sha256, request, values, key)

    def _new_job(self, path: str, changes: dict[str, Any] | None, key: str) -> JobView:
        headers = {"Idempotency-Key": key or secrets.token_hex(16)}
        return self._transport.ask(JobView, "POST", path, headers=headers, json=changes or {})
