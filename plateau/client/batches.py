"""Calls that submit, show, list and steer batches."""

from collections.abc import Iterator, Mapping, Sequence

from plateau.client.short_ids import with_whole_ids
from plateau.client.submission import refusing, submitted
from plateau.client.transport import Calls
from plateau.farm.model.seeds import JOB_SEEDS
from plateau.farm.model.spec import BatchSpec, JobSpec, SharedSpec, parameter_strings
from plateau.farm.wire.batch_views import (
    BatchLineView,
    BatchPage,
    BatchSteered,
    BatchView,
    batch_path,
)
from plateau.farm.wire.shot_views import ShotView, shot_path
from plateau.files.scene_at_hand import SceneAtHand


class BatchCalls(Calls):
    """Batches: many jobs under one name.

    A call that takes a batch's name raises `ApiError` ``unknown-batch`` if there is none.
    """

    def submit_batch(
        self,
        scene: SceneAtHand,
        parameters: Sequence[Mapping[str, str | int | float | bool]],
        spec: JobSpec | None = None,
        *,
        same_seeds: bool = False,
        first_frame: int = 0,
        idempotency_key: str | None = None,
    ) -> BatchView:
        """Submit a scene once for each of these sets of parameters; all jobs are made, or none.

        Parameters
        ----------
        scene
            As for `Client.submit`; the files of all jobs are packed.
        parameters
            For each job the values of the scene's ``$parameters``; 1 to 1000 jobs.
        spec
            How all jobs are sampled, judged and stopped. Its `parameters` are the defaults of each
            job; its `batch` names the batch, for which the service otherwise makes a name. Its
            `seed` is the first job's, and each further job has the next.
        same_seeds
            Give all jobs the seed of the first one, so that the noise of frames stands still.
        first_frame
            Which frame of a longer list the first of these is, from 0: seeds are counted from
            there, as if all had been submitted together.
        idempotency_key
            As for `Client.submit`.

        Raises
        ------
        InvalidSpec
            There are no parameters, or too many.
        plateau.farm.bundle.BundleError, ApiError
            As for `Client.submit`.
        """
        spec = with_whole_ids(spec or JobSpec(), self._transport.whole_id)
        shared = {name: getattr(spec, name) for name in SharedSpec.model_fields}
        entries = tuple({**spec.parameters, **values} for values in parameters)
        with refusing():
            more = {"same_seeds": same_seeds, "first_frame": first_frame % JOB_SEEDS}
            asked = BatchSpec.model_validate({**shared, "parameters": entries, **more})
        values = map(parameter_strings, entries)
        request = asked.as_request()
        return submitted(self._transport, BatchView, scene, request, values, idempotency_key)

    def batch(self, name: str) -> BatchView:
        """The current state of the batch, summed over its jobs; `Client.all_jobs` has the jobs."""
        return self._transport.read(BatchView, batch_path(name))

    def shot(self, name: str) -> ShotView:
        """The newest shot of the batch, frame by frame, and each judgement of it.

        Raises
        ------
        ApiError
            ``no-shot`` if its jobs were not submitted as a shot.
        """
        return self._transport.read(ShotView, shot_path(name))

    def all_batches(self) -> Iterator[BatchLineView]:
        """Every batch, those with the newest jobs first; pages are fetched as they are needed."""
        params: dict[str, str | int] = {"limit": 100}  # the most
        while True:
            page = self._transport.read(BatchPage, "/v1/batches", params=params)
            yield from page.batches
            if page.next_cursor is None:
                return
            params["cursor"] = page.next_cursor

    def cancel_batch(self, name: str) -> BatchSteered:
        """Cancel all jobs of the batch that have not ended; returns the outcome for each job."""
        return self._steer_batch(name, "cancel")

    def pause_batch(self, name: str) -> BatchSteered:
        """Pause the batch: workers take no slice of its jobs; returns the outcome for each job."""
        return self._steer_batch(name, "pause")

    def resume_batch(self, name: str) -> BatchSteered:
        """Resume the paused batch; returns the outcome for each job."""
        return self._steer_batch(name, "resume")

    def delete_batch(self, name: str) -> BatchSteered:
        """Delete the batch's jobs that have ended; returns the outcome for each job."""
        return self._transport.ask(BatchSteered, "DELETE", batch_path(name))

    def restore_batch(self, name: str) -> BatchSteered:
        """Restore the batch's deleted jobs; returns the outcome for each job."""
        return self._steer_batch(name, "restore")

    def _steer_batch(self, name: str, action: str) -> BatchSteered:
        return self._transport.ask(BatchSteered, "POST", f"{batch_path(name)}/{action}")
