"""How far beyond its merged slices a job is planned."""

from typing import Final

from farm.job import Job
from farm.spec import FixedSpec, VisibleSpec

#: Beyond an evaluation that may end the job, so many slices are planned for each merged one: they
#: keep workers busy while it is merged and judged, and are rendered for nothing where it ends.
SPARE: Final = 0.04

#: The rule `visible` ends no job earlier, and until the first it has no forecast.
_EVALUATIONS_BEFORE_AN_END: Final = 2


class LookAhead:
    """The slices of one job that workers may render before it is known whether they are needed.

    Far from its end, there are always so many that no worker waits. Near it they end with the
    evaluation at which the job is expected to: what is rendered beyond that is wasted, and a worker
    that finds nothing to do renders another job. The curve and the image do not depend on it.
    """

    def __init__(self, job: Job) -> None:
        self._spec, rule = job.spec, job.spec.rule
        self._least_spp = self._spec.min_spp or 0
        self._expected_spp: int | None = None
        if isinstance(rule, FixedSpec):
            self.expect(rule.spp)
        elif isinstance(rule, VisibleSpec):
            self._least_spp = max(self._least_spp, rule.min_spp)
            soonest_spp = _EVALUATIONS_BEFORE_AN_END * self._spec.step
            self.expect(job.forecast_spp if job.points else soonest_spp)

    def expect(self, spp: int | None) -> None:
        """Take note of where the rule is likely to end the job, as an evaluation has it."""
        self._expected_spp = None if spp is None else max(spp, self._least_spp)

    def stop(self, merged: int, enough: int) -> int:
        """The index of the first slice that is not planned yet.

        Parameters
        ----------
        merged
            Slices that are merged.
        enough
            Slices beyond those that keep every worker busy.
        """
        stop = min(merged + enough, self._spec.max_slices)
        if self._expected_spp is None:
            return stop
        # Until the expected end is behind, it may be at the next evaluation.
        soonest_spp = max(self._expected_spp, merged * self._spec.slice_spp + 1)
        evaluations = -(-soonest_spp // self._spec.step)
        last = evaluations * self._spec.step // self._spec.slice_spp
        return min(stop, last + int(SPARE * merged))
