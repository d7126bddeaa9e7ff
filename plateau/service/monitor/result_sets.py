"""The pictures of a job: the merged image, and where it differs from the first."""

import hashlib
import logging
from dataclasses import replace
from functools import partial

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.images.exr import decode_partial
from plateau.farm.ledger.ownership import Ownership, Ownerships
from plateau.farm.model.errors import CorruptPartial
from plateau.farm.model.job import Job
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.picture.denoised import Denoised
from plateau.picture.facts import Facts, facts_of
from plateau.picture.judge import Judge
from plateau.picture.merge import Merge
from plateau.picture.previews import Previews
from plateau.picture.result_files import NoiseMaps, result_files
from plateau.service.monitor.room import has_room_to_show

_LOG = logging.getLogger(__name__)


class ResultSets:
    """Writes and shows a job's sets of pictures.

    Each set has its own name and is shown by one fenced write to Redis. So clients see whole sets
    only, and a monitor that has lost the job cannot replace a newer one.
    """

    def __init__(self, owned: Ownership, owners: Ownerships, store: Blobs, spec: JobSpec) -> None:
        self._owned = owned
        self._owners = owners
        self._blobs = store
        self._spec = spec
        self._previews = Previews(store, owned.job_id, note=partial(owners.note_blob, owned))
        self._shown: str | None = None

    def show_glimpse(self, job: Job, judge: Judge) -> int | None:
        """Show the first pass of the first slice, since a slice may take minutes.

        Returns its spp, 0 if it cannot be shown, or None if there is none yet.
        """
        blob = self._owners.glimpse(self._owned.job_id)
        if blob is None:
            return None
        try:
            if not blobs.is_partial(blob):
                raise CorruptPartial(f"{blob!r} is no partial's name")
            content = self._blobs.get(blob)
            if not has_room_to_show(content):
                return 0
            first = decode_partial(content)
            if not 0 < first.spp < self._spec.slice_spp:
                raise CorruptPartial(f"a first pass of {first.spp} spp")
        except (FileNotFoundError, CorruptPartial) as error:
            _LOG.warning("the first pass cannot be shown: %s", error)
            return 0
        glimpse = replace(Merge.of(self._spec), slice_spp=first.spp)
        glimpse.add_partial(first)
        self.show(job, glimpse, judge)
        self._blobs.delete(blob)
        return first.spp

    def show(
        self,
        job: Job,
        merge: Merge,
        judge: Judge,
        denoised: Denoised | None = None,
        *,
        is_point: bool = False,
    ) -> None:
        """Show the merged image, denoised or as it is, of a job that has not ended.

        That of a point is kept.
        """
        facts = facts_of(job, merge, job.state, job.reason, denoised)
        # Not compressed, as the next set comes soon.
        pictures = self._pictures(merge, judge, facts, denoised, compressed=False)
        (written, sha256), before = self._put(merge.spp, pictures, self._owned.token), self._shown
        self._owners.show_results(self._owned, written, merge.spp, sha256)
        if is_point and "image.png" in pictures:
            self._previews.keep(merge.spp, pictures["image.png"])
        self._shown = written
        if before not in {None, written}:
            self._blobs.delete(*self._blobs.names(f"{before}/"))

    def write(
        self,
        job: Job,
        merge: Merge,
        judge: Judge,
        denoised: Denoised | None = None,
        *,
        state: JobState,
        reason: str,
    ) -> tuple[str, dict[str, str]]:
        """Write the final pictures without showing them.

        Parameters
        ----------
        job, merge, judge, denoised
            The job, its image and its rules, and the image denoised, if it is.
        state, reason
            In which it ends, and why.

        Returns
        -------
        The set's name, and the SHA-256 of each of its files by name.
        """
        facts = facts_of(job, merge, state, reason, denoised)
        pictures = self._pictures(merge, judge, facts, denoised, compressed=True)
        return self._put(merge.spp, pictures, f"{self._owned.token}{blobs.FINAL}")

    def _pictures(
        self,
        merge: Merge,
        judge: Judge,
        facts: Facts,
        denoised: Denoised | None,
        *,
        compressed: bool,
    ) -> dict[str, bytes]:
        blend = None if denoised is None else denoised.blend
        visible, noise = None, NoiseMaps()
        if self._spec.pictures:
            visible, noise = judge.visible_map(merge, blend), judge.noise_maps(merge, denoised)
        return result_files(merge, visible, noise, facts, self._spec, blend, compressed=compressed)

    def _put(self, spp: int, pictures: dict[str, bytes], token: str) -> tuple[str, dict[str, str]]:
        name = blobs.result_set(self._owned.job_id, spp, token)
        for picture, content in pictures.items():
            self._blobs.put(f"{name}/{picture}", content)
        return name, {
            picture: hashlib.sha256(content).hexdigest() for picture, content in pictures.items()
        }
