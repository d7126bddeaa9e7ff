"""How far beyond its merged slices a job is planned."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

from plateau.farm.model.fit import Kind
from plateau.farm.model.job import Job, Worker
from plateau.farm.model.spec import JobSpec

#: Beyond an evaluation that may end the job, so many slices are planned for each merged one: they
#: keep workers busy while it is merged and judged, and are rendered for nothing where it ends.
SPARE: Final = 0.04


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


@dataclass(frozen=True, kw_only=True)
class LookAhead:
    """The slices of one job that workers may render before it is known whether they are needed.

    Far from its end, there are always so many that no worker waits. Near it they end with the
    evaluation at which the job is expected to: what is rendered beyond that is wasted, and a worker
    that finds nothing to do renders another job. The curve and the image do not depend on it.
    """

    spec: JobSpec
    expected_spp: int | None = None  #: where the rule is likely to end it; None while nothing tells

    @classmethod
    def of(cls, job: Job) -> "LookAhead":
        """Return the look-ahead of a job as its rule and its curve so far have it."""
        rule = job.spec.rule.behaviour
        return cls(spec=job.spec).expecting(
            rule.expected_end_spp(job.forecast_spp)
            if job.points
            else rule.soonest_end_spp(job.spec.step)
        )

    def expecting(self, spp: int | None) -> "LookAhead":
        """Return it as an evaluation leaves it that expects the job to end at this spp."""
        least_spp = self.spec.min_spp or 0  # the rule ends no job earlier
        return replace(self, expected_spp=None if spp is None else max(spp, least_spp))

    def expected_end_spp(self, merged: int) -> int:
        """Where the job is expected to end, after so many merged slices: a guess, never a promise.

        One whose end is not in sight is taken to be at its half.
        """
        merged_spp = merged * self.spec.slice_spp
        expected_spp = 2 * merged_spp if self.expected_spp is None else self.expected_spp
        return min(max(expected_spp, merged_spp), self.spec.max_spp)

    def stop(self, merged: int, enough: int) -> int:
        """The index of the first slice that is not planned yet.

        Parameters
        ----------
        merged
            Slices that are merged.
        enough
            Slices beyond those that keep every worker busy.
        """
        stop = min(merged + enough, self.spec.max_slices)
        if self.expected_spp is None:
            return stop
        # Until the expected end is behind, it may be at the next evaluation.
        soonest_spp = max(self.expected_spp, merged * self.spec.slice_spp + 1)
        evaluations = -(-soonest_spp // self.spec.step)
        last = evaluations * self.spec.step // self.spec.slice_spp
        return min(stop, last + int(SPARE * merged))
