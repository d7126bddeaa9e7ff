"""Calls that submit, show, list and steer batches."""

import math
import secrets
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from plateau.client.errors import TimedOut
from plateau.client.transport import Calls
from plateau.farm.model.spec import BatchSpec, JobSpec, SharedSpec, parameter_strings
from plateau.farm.wire.batch_views import (
    BatchLineView,
    BatchPage,
    BatchSteered,
    BatchView,
    batch_path,
)
from plateau.files.packing import pack

#: As many as the service puts on one page.
_LARGEST_PAGE: Final = 100
_LOOK_EVERY_S: Final = 1.0


class BatchCalls(Calls):
    """Batches: many jobs under one name."""

    def submit_batch(
        self,
        scene: Path | str,
        parameters: Sequence[Mapping[str, str | int | float | bool]],
        spec: JobSpec | None = None,
        *,
        idempotency_key: str | None = None,
    ) -> BatchView:
        """Submit a scene once for each of these parameters: all jobs are made, or none.

        Parameters
        ----------
        scene
            An XML, a zip, a folder with ``scene.xml``; or the SHA-256 of a stored scene. What is
            packed is all that any of the jobs needs.
        parameters
            For each job the values of the scene's ``$parameters``, 1 to 1000.
        spec
            How all of them are sampled, judged and stopped. Its own `parameters` are those of every
            job that does not have others; its `batch` names the batch, which has a name made up
            otherwise.
        idempotency_key
            As `Client.submit` has it.

        Raises
        ------
        plateau.farm.bundle.BundleError
            The scene's files cannot be packed: one is missing, or not allowed.
        pydantic.ValidationError
            The list has no entry, or too many.
        ApiError
            ``broken-scene``, ``unknown-scene``, ``upload-too-large``, ``idempotency-key-reused``;
            ``uneven-batch`` where the batch is guarded against flicker.
        """
        spec = spec or JobSpec()
        shared = {name: getattr(spec, name) for name in SharedSpec.model_fields}
        entries = tuple({**spec.parameters, **values} for values in parameters)
        asked = BatchSpec(**shared, parameters=entries)
        headers = {"Idempotency-Key": idempotency_key or secrets.token_hex(16)}
        parts: dict[str, Any] = {"spec": (None, asked.as_request())}
        if isinstance(scene, str):
            parts["scene_sha256"] = (None, scene)
            return self._batch_submitted(headers, parts)
        with pack(scene, *map(parameter_strings, entries)) as packed:
            name = f"{scene.resolve().name}.zip" if scene.is_dir() else packed.name
            parts["scene"] = (name, packed.file, packed.media_type)  # httpx rewinds it each time
            return self._batch_submitted(headers, parts)

    def batch(self, name: str) -> BatchView:
        """The batch as it stands, summed up over its jobs; `Client.all_jobs` has the jobs.

        Raises
        ------
        ApiError
            ``unknown-batch``.
        """
        return self._transport.read(BatchView, batch_path(name))

    def batches(self, *, cursor: str | None = None, limit: int = 20) -> BatchPage:
        """A page of batches, those with the newest jobs first; `limit` is 1 to 100."""
        asked = {"cursor": cursor, "limit": limit}
        params = {name: value for name, value in asked.items() if value is not None}
        return self._transport.read(BatchPage, "/v1/batches", params=params)

    def all_batches(self) -> Iterator[BatchLineView]:
        """Every batch, those with the newest jobs first; pages are fetched as they are needed."""
        cursor = None
        while True:
            page = self.batches(cursor=cursor, limit=_LARGEST_PAGE)
            yield from page.batches
            cursor = page.next_cursor
            if cursor is None:
                return

    def wait_for_batch(self, name: str, *, timeout_s: float | None = None) -> BatchView:
        """The batch once all of its jobs are finished: ended, with their results written.

        Raises
        ------
        ApiError
            ``unknown-batch``.
        TimedOut
            They were not finished in time; they go on.
        """
        deadline = math.inf if timeout_s is None else time.monotonic() + timeout_s
        while True:
            batch = self.batch(name)
            if batch.finished == batch.jobs:
                return batch
            left_s = deadline - time.monotonic()
            if left_s <= 0:
                raise TimedOut(f"batch {name}", timeout_s or 0.0)
            time.sleep(min(_LOOK_EVERY_S, left_s))

    def cancel_batch(self, name: str) -> BatchSteered:
        """Cancel all jobs of the batch that have not ended; says what became of each.

        Raises
        ------
        ApiError
            ``unknown-batch``.
        """
        return self._steer_batch(name, "cancel")

    def pause_batch(self, name: str) -> BatchSteered:
        """Pause the batch: no slice of any of its jobs is taken; says what became of each.

        Raises
        ------
        ApiError
            ``unknown-batch``.
        """
        return self._steer_batch(name, "pause")

    def resume_batch(self, name: str) -> BatchSteered:
        """Let the paused batch go on; says what became of each job.

        Raises
        ------
        ApiError
            ``unknown-batch``.
        """
        return self._steer_batch(name, "resume")

    def _batch_submitted(self, headers: dict[str, str], parts: dict[str, Any]) -> BatchView:
        answer = self._transport.send("POST", "/v1/jobs", headers=headers, files=parts)
        return self._transport.understood(BatchView, answer)

    def _steer_batch(self, name: str, what: str) -> BatchSteered:
        answer = self._transport.send("POST", f"{batch_path(name)}/{what}")
        return self._transport.understood(BatchSteered, answer)
