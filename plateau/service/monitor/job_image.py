"""The merged image of one job, denoised: asked for, waited for, and tried again."""

import logging
from concurrent.futures import Future

from plateau.farm.model.states import MAX_TRIES
from plateau.farm.process.child import NoAnswer
from plateau.picture.denoised import Denoised, DenoisingTask
from plateau.picture.denoising import oidn
from plateau.picture.denoising.process import Denoising, TooLarge
from plateau.picture.merged_image import MergedImage
from plateau.service.monitor.known import Known

_LOG = logging.getLogger(__name__)


class JobImage:
    """The denoised image of a job, if there is one of the slices that are merged.

    Raises
    ------
    ValueError
        The job is denoised, and this machine has no denoiser.
    """

    def __init__(self, job_id: str, *, is_denoised: bool, denoising: Denoising) -> None:
        if is_denoised and not oidn.is_installed():
            raise ValueError(oidn.MISSING)
        self._job_id = job_id
        self._denoising = denoising
        self._asked: tuple[int, Future[Denoised]] | None = None  # and of how many slices
        self._last: tuple[int, Denoised | None] = 0, None  # and of how many slices
        self._failures = 0  # one after the other

    def of(self, merge: MergedImage) -> Denoised | None:
        """Return the merged image denoised, if it is."""
        slices, denoised = self._last
        return denoised if slices == merge.slices else None

    def denoise(self, merge: MergedImage, known: Known) -> bool:
        """Return whether the merged image is denoised; have it denoised unless it is by now.

        An ended job whose image cannot be denoised has it as it is.

        Raises
        ------
        ValueError
            It could not be denoised several times or is too large, and the job has not ended.
        """
        slices, has_ended = merge.slices, known.job.state.ended
        if self._asked is not None and self._asked[0] == slices:
            future = self._asked[1]
            if not future.done():
                return False
            self._asked = None
            self._note(slices, future, has_ended=has_ended)
            if self.of(merge) is not None or self._failures >= MAX_TRIES:
                return True
        task = DenoisingTask.of(merge, known.job.spec, is_point=known.plan.is_point(slices))
        try:
            self._asked = slices, self._denoising.start(self._job_id, task)
        except TooLarge as too_large:
            _LOG.warning("%s", too_large)
            if not has_ended:
                raise ValueError(f"the image cannot be denoised: {too_large}") from too_large
        return self._asked is None

    def _note(self, slices: int, future: Future[Denoised], *, has_ended: bool) -> None:
        """Note the answer, or that there was none."""
        try:
            self._last = slices, future.result()
            self._failures = 0
        except NoAnswer as failed:
            self._failures += 1
            _LOG.warning("the image of %d slices was not denoised: %s", slices, failed)
            if self._failures >= MAX_TRIES:
                self._last = slices, None
                if not has_ended:
                    raise ValueError(f"the image cannot be denoised: {failed}") from failed
