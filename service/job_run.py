"""One job, run by the monitor that owns it: plan, merge, judge, end, and write the results."""

import hashlib
import logging
import time
from typing import Final

from farm import blobs
from farm.blobs import Blobs
from farm.errors import CorruptPartial, IllegalTransition
from farm.exr import decode_partial, encode_image
from farm.job import Job
from farm.jobs import Jobs
from farm.ownership import Ownership, Ownerships
from farm.png import encode_png
from farm.queue import SliceRecord
from farm.states import JobState
from metric import difference_picture, encode_srgb
from service.judge import Judge, Judgement
from service.merge import Merge, pack_checkpoint, unpack_checkpoint

_LOG = logging.getLogger(__name__)

_CHECKPOINT_S: Final = 5.0  #: at least so long between two checkpoints
_PREVIEW_S: Final = 2.0  #: and between two previews
_BATCH: Final = 16  #: records read from the ledger at once


class JobRun:
    """The progress of one job. `advance` may be called at any time, and again after any error.

    What it has merged is a prefix of the slices, so it is the same whatever died on the way; a
    monitor that takes over starts from the last checkpoint and comes to the same points.
    """

    def __init__(self, owned: Ownership, jobs: Jobs, owners: Ownerships, store: Blobs) -> None:
        self.owned = owned
        self._jobs = jobs
        self._owners = owners
        self._blobs = store
        job = jobs.get(owned.job_id)
        self._spec = job.spec
        self._judge = Judge(job.spec)
        self._merge = Merge(slice_spp=job.spec.slice_spp)
        self._judgement: Judgement | None = None  # made, but not yet written down
        self._contained: list[str] = []  # partials in the sums, not yet in a checkpoint
        self._checkpoint = owners.checkpoint(job.id)
        self._checkpoint_at = self._preview_at = time.monotonic()
        self._planned_stop = -1
        if self._checkpoint is not None:
            self._recover(self._checkpoint)

    def advance(self, look_ahead: int) -> bool:
        """Do all that can be done now; returns whether the job is finished with.

        Raises
        ------
        FenceLost
            Another monitor owns the job.
        StoreUnavailable
            Call again later.
        CorruptPartial, FileNotFoundError, ValueError
            A slice cannot be merged, now or later.
        """
        job = self._jobs.get(self.owned.job_id)
        if not job.state.ended:
            self._plan(look_ahead)
            self._merge_and_judge()
            self._check_time(job)
            self._plan(look_ahead)
            job = self._jobs.get(self.owned.job_id)
        if job.state.ended:
            self._finish(job)
            return True
        return False

    def _plan(self, look_ahead: int) -> None:
        """Keep so many slices planned beyond the merged ones."""
        stop = min(self._merge.slices + look_ahead, self._spec.max_slices)
        if stop > self._planned_stop:
            self._owners.plan(self.owned, range(self._merge.slices, stop))
            self._planned_stop = stop

    def _merge_and_judge(self) -> None:
        while self._judged():
            records = self._owners.committed(
                self.owned.job_id, range(self._merge.slices, self._merge.slices + _BATCH)
            )
            if not records:
                return
            for record in records:
                self._add(record)
                if self._spec.evaluates_at(self._merge.spp):
                    self._judgement = self._judge.judge(self._merge)
                    break

    def _judged(self) -> bool:
        """Write down the judgement in hand, if any; returns whether the job goes on."""
        if self._judgement is None:
            return True
        point, verdict, spp = self._judgement.point, self._judgement.verdict, self._merge.spp
        self._owners.append_point(self.owned, spp, point)
        if verdict.stop:
            self._end(JobState.CONVERGED, verdict.reason, verdict.numbers)
        elif spp == self._spec.max_spp:
            self._end(JobState.EXHAUSTED, f"reached the cap of {spp} spp; {verdict.reason}")
        else:
            self._preview()
            self._save_checkpoint()
            self._judgement = None
            return True
        self._judgement = None
        return False

    def _add(self, record: SliceRecord) -> None:
        content = self._blobs.get(record.blob)
        if hashlib.sha256(content).hexdigest() != record.sha256:
            raise CorruptPartial(f"{record.blob} is not what its worker uploaded")
        self._merge.add(decode_partial(content).pixels)
        self._contained.append(record.blob)

    def _check_time(self, job: Job) -> None:
        limit_s = self._spec.time_limit_s
        if limit_s is None or job.started_at is None:
            return
        if self._jobs.now_ms() / 1000 - job.started_at.timestamp() > limit_s:
            self._end(
                JobState.EXHAUSTED,
                f"reached its time limit of {limit_s:g} s at {self._merge.spp} spp",
            )

    def _end(
        self, state: JobState, reason: str, verdict: dict[str, float | None] | None = None
    ) -> None:
        try:
            self._owners.end(self.owned, state, reason, verdict)
        except IllegalTransition as refused:
            _LOG.info("%s", refused)  # it was cancelled, or it failed, a moment ago

    # Checkpoints.

    def _save_checkpoint(self) -> None:
        """Put the sums and the rules' memory into a blob; then the partials in it may go."""
        if time.monotonic() < self._checkpoint_at + _CHECKPOINT_S:
            return
        numbers, images = self._judge.memory()
        about = {"slices": self._merge.slices, "rules": numbers}
        name = f"{blobs.checkpoints(self.owned.job_id)}{self._merge.spp:07d}-{self.owned.token}.npz"
        arrays = {**self._merge.arrays(), **{f"rule:{key}": image for key, image in images.items()}}
        self._blobs.put(name, pack_checkpoint(about, arrays))
        self._owners.save(self.owned, checkpoint=name)
        if self._checkpoint not in {None, name}:
            self._blobs.delete(self._checkpoint)
        if not self._spec.keep_slices:
            self._blobs.delete(*self._contained)
        self._contained = []
        self._checkpoint = name
        self._checkpoint_at = time.monotonic()

    def _recover(self, checkpoint: str) -> None:
        about, arrays = unpack_checkpoint(self._blobs.get(checkpoint))
        self._merge = Merge.from_arrays(self._spec.slice_spp, about["slices"], arrays)
        images = {
            name.removeprefix("rule:"): image
            for name, image in arrays.items()
            if name.startswith("rule:")
        }
        self._judge.recall(about["rules"], images)

    # Results.

    def _finish(self, job: Job) -> None:
        """Write the results of the job's prefix and clear everything else."""
        self._merge_up_to(job)
        if self._merge.slices:
            self._write_pictures()
        kept = self._slices_to_keep(job)
        partials = set(self._blobs.names(blobs.partials(job.id)))
        self._blobs.delete(*(partials - kept), *self._blobs.names(blobs.checkpoints(job.id)))
        self._owners.finish(self.owned, spp=self._merge.spp)

    def _slices_to_keep(self, job: Job) -> set[str]:
        """The partials of every slice in the ledger, where the job keeps its slices."""
        if not self._spec.keep_slices:
            return set()
        return {record["blob"] for record in self._jobs.ledger(job.id).values()}

    def _merge_up_to(self, job: Job) -> None:
        """Merge what belongs to the final image but was not merged before the job ended.

        A converged job's image is the one that was judged, and a failed one's is what there is;
        any other takes every sample that was rendered.
        """
        last = {
            JobState.CONVERGED: job.spp // self._spec.slice_spp,
            JobState.FAILED: self._merge.slices,
        }.get(job.state, self._spec.max_slices)
        while self._merge.slices < last:
            stop = min(self._merge.slices + _BATCH, last)
            records = self._owners.committed(job.id, range(self._merge.slices, stop))
            if not records:
                return
            for record in records:
                self._add(record)
                if self._spec.evaluates_at(self._merge.spp) and self._merge.spp <= job.spp:
                    self._judge.judge(self._merge)  # what the curve has already

    def _preview(self) -> None:
        if time.monotonic() >= self._preview_at + _PREVIEW_S:
            self._write_pictures()
            self._preview_at = time.monotonic()

    def _write_pictures(self) -> None:
        image, exposure_ev = self._merge.image(), self._spec.view.exposure_ev
        pictures = {
            "image.exr": encode_image(
                image, {"plateau:job": self.owned.job_id, "plateau:spp": self._merge.spp}
            ),
            "image.png": encode_png(encode_srgb(image, exposure_ev)),
        }
        visible = self._judge.visible_map(self._merge)
        if visible is not None:
            pictures["difference.png"] = encode_png(difference_picture(image, visible, exposure_ev))
        for name, content in pictures.items():
            self._blobs.put(blobs.result(self.owned.job_id, name), content)
