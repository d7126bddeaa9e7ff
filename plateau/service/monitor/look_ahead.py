"""How far a job is planned beyond its merged slices."""

from dataclasses import dataclass, replace
from typing import Final

from plateau.farm.model.job import Job
from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.spec import JobSpec

#: Slices planned beyond an evaluation that may end the job, for each merged one. They keep workers
#: busy during the evaluation, and are wasted if the job ends with it.
SPARE: Final = 0.04


def enough(fitting: int) -> int:
    """The number of slices beyond the merged ones that keep so many workers busy.

    Each worker renders one and has the next one waiting; one more is being merged.
    """
    return 2 * max(1, fitting) + 1


@dataclass(frozen=True, kw_only=True)
class LookAhead:
    """The slices of one job that workers may render before it is known whether they are needed.

    Far from the job's end they are enough that no worker waits. Near it they end with the
    evaluation at which the job is expected to end: later slices would be wasted, and a worker
    without one renders another job. The curve and the image do not depend on the look-ahead.
    """

    spec: JobSpec
    expected_spp: int | None = None  #: where the rule is likely to end the job; None if unknown

    @classmethod
    def of(cls, job: Job) -> "LookAhead":
        """The look-ahead of a job, by its rule and its curve so far."""
        rule = job.spec.rule.behaviour
        return cls(spec=job.spec).expecting(
            job.expected_spp if job.points else rule.soonest_end_spp(job.spec.step)
        )

    def expecting(self, spp: int | None) -> "LookAhead":
        """The look-ahead after an evaluation that expects the job to end at this spp."""
        least_spp = self.spec.min_spp or 0  # no rule ends the job earlier
        return replace(self, expected_spp=None if spp is None else max(spp, least_spp))

    def expected_end_spp(self, merged_spp: int) -> int:
        """An estimate of the spp at which the job ends, after so many merged.

        A job whose end is unknown is assumed to be half done.
        """
        expected_spp = 2 * merged_spp if self.expected_spp is None else self.expected_spp
        return min(max(expected_spp, merged_spp), self.spec.max_spp)

    def stop(self, plan: Plan, merged: int, enough: int) -> int:
        """The index of the first slice that should not be planned yet.

        `enough` slices beyond the `merged` ones keep every worker busy.
        """
        stop = min(merged + enough, plan.stop)
        if self.expected_spp is None:
            return stop
        # Once the expected end has passed, any next evaluation may be the last.
        last = plan.point_from(max(self.expected_spp, plan.spp(merged) + 1))
        return min(stop, last + int(SPARE * merged))
