"""How far beyond its merged slices a job is planned."""

from collections import Counter
from collections.abc import Iterable
from typing import Final

from plateau.farm.model.fit import Kind
from plateau.farm.model.job import Job, Worker
from plateau.farm.model.spec import FixedSpec, VisibleSpec

#: Beyond an evaluation that may end the job, so many slices are planned for each merged one: they
#: keep workers busy while it is merged and judged, and are rendered for nothing where it ends.
SPARE: Final = 0.04

#: The rule `visible` ends no job earlier, and until the first it has no forecast.
_EVALUATIONS_BEFORE_AN_END: Final = 2


class Crew:
    """The workers that live and take work."""

    def __init__(self, workers: Iterable[Worker]) -> None:
        self._kinds = Counter(
            Kind(worker.variants, worker.pool, worker.tags)
            for worker in workers
            if not worker.drained and worker.trouble is None
        )

    def enough(self, job: Job) -> int:
        """So many slices beyond the merged ones keep all busy that may render the job.

        Enough for each to render one and to find the next waiting, and one in the merge.
        """
        fit = sum(count for kind, count in self._kinds.items() if kind.serves(job))
        return 2 * max(1, fit) + 1


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

    def expected_end_spp(self, merged: int) -> int:
        """Where the job is expected to end, after so many merged slices: a guess, never a promise.

        One whose end is not in sight is taken to be at its half.
        """
        merged_spp = merged * self._spec.slice_spp
        expected_spp = 2 * merged_spp if self._expected_spp is None else self._expected_spp
        return min(max(expected_spp, merged_spp), self._spec.max_spp)

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
