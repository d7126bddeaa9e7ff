"""Checkpoints of a job: its sums and the memory of its rules, in one blob."""

from __future__ import annotations

import hashlib
import json
import logging
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.ownership import Checkpoint, Ownership, Ownerships
from plateau.farm.model.errors import CorruptPartial
from plateau.farm.model.shot import FrameWait
from plateau.farm.model.spec import JobSpec
from plateau.picture.denoised import packed, unpacked
from plateau.picture.merge import Merge

if TYPE_CHECKING:
    from plateau.picture.judge import Judge

_LOG = logging.getLogger(__name__)


class Checkpoints:
    """The last checkpoint of a job, and the partials that are not in it yet.

    A partial is deleted once a checkpoint contains it, unless the job keeps its slices. The slices
    of a lost or damaged checkpoint are rendered again.
    """

    def __init__(
        self, owned: Ownership, owners: Ownerships, store: Blobs, *, keep_slices: bool
    ) -> None:
        self._owned = owned
        self._owners = owners
        self._blobs = store
        self._keep_slices = keep_slices
        self._contained: list[str] = []  # partials in the sums, not yet in a checkpoint
        self._last = owners.checkpoint(owned.job_id)

    def note(self, partial: str) -> None:
        """Note that the sums contain this partial."""
        self._contained.append(partial)

    def save(self, merge: Merge, judge: Judge, waits: FrameWait | None = None) -> None:
        """Save the sums and the rules' memory, then delete the partials in them.

        `waits` says with what a frame waits for a look at its shot.
        """
        numbers, images = judge.memory()
        about = {"rules": numbers, "film": merge.about()}
        arrays = {"about": np.array(json.dumps(about)), **merge.arrays()}
        content = bytes(packed(arrays | {f"rule:{name}": image for name, image in images.items()}))
        saved = Checkpoint(
            blob=f"{blobs.checkpoints(self._owned.job_id)}{merge.slices:07d}-{self._owned.token}.npz",
            sha256=hashlib.sha256(content).hexdigest(),
            slices=merge.slices,
        )
        self._blobs.put(saved.blob, content)
        self._owners.save_checkpoint(self._owned, saved, waits)
        before, self._last = self._last, saved
        if before is not None and before.blob != saved.blob:
            self._delete_own(before.blob)
        if not self._keep_slices:
            self._delete_own(*self._contained)
        self._contained = []

    def recover(self, spec: JobSpec, judge: Judge) -> Merge:
        """Return the sums of the last checkpoint, and restore the judge's memory.

        Without a readable checkpoint, the sums are empty.
        """
        if self._last is None:
            return Merge.of(spec)
        try:
            sums = stored_sums(self._blobs, self._last)
            merge, memory = unpacked_sums(sums, self._last.slices, spec)
        except (FileNotFoundError, CorruptPartial) as error:
            _LOG.warning("the merge starts again: %s", error)
            self._render_again(self._last)
            return Merge.of(spec)
        judge.recall(*memory)
        return merge

    def _delete_own(self, *names: str) -> None:
        """Delete those of these blobs that are the job's own, not those of the job it continues."""
        own = blobs.of_job(self._owned.job_id)
        self._blobs.delete(*(name for name in names if name.startswith(own)))

    def _render_again(self, lost: Checkpoint) -> None:
        """Have the slices of a lost checkpoint rendered again whose partials are deleted."""
        records = self._owners.committed(self._owned.job_id, range(lost.slices))
        folders = {f"{record.blob.rpartition('/')[0]}/" for record in records}
        stored = {name for folder in folders for name in self._blobs.names(folder)}
        for record in records:
            if record.blob not in stored:
                self._owners.reject(self._owned, record, "the checkpoint that had it was lost")


def stored_sums(store: Blobs, checkpoint: Checkpoint) -> bytes:
    """Return the bytes of a checkpoint.

    Raises
    ------
    FileNotFoundError
        The blob store does not have it.
    CorruptPartial
        Its bytes are not those that were saved.
    """
    content = store.get(checkpoint.blob)
    if hashlib.sha256(content).hexdigest() != checkpoint.sha256:
        raise CorruptPartial(f"the checkpoint {checkpoint.blob} is not what was saved")
    return content


def unpacked_sums(
    content: bytes, slices: int, spec: JobSpec
) -> tuple[Merge, tuple[dict[str, Any], dict[str, NDArray[Any]]]]:
    """Return the sums of so many slices, and the rules' memory as `Judge.recall` takes it."""
    arrays = unpacked(content)
    about: dict[str, Any] = json.loads(str(arrays.pop("about")))
    images = {
        name.removeprefix("rule:"): image
        for name, image in arrays.items()
        if name.startswith("rule:")
    }
    merge = Merge.of(spec)
    merge.restore(slices, arrays, about["film"])
    return merge, (about["rules"], images)
