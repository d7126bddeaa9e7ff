"""Jobs of a `NoiseFarm` that are rendered to their end, with quiet monitors and with busy ones."""

from typing import Any

from plateau.farm.ledger.continuation import Continuations, changed_spec, lost_by
from plateau.farm.ledger.totals import take_census
from plateau.farm.model.job import Job
from plateau.farm.model.spec import JobSpec
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.faults.invariants import check_job
from tests.support.until import until


def finished(farm: NoiseFarm, **spec: object) -> Job:
    """A finished job of this spec, of which everything holds that must."""
    job = farm.submit(**spec)
    with farm.monitor():
        done = farm.finish(job)
    check_job(farm.jobs, farm.store, farm.jobs._redis, job.id)
    return done


def finish_by_many_monitors(farm: NoiseFarm, job: Job) -> None:
    """Finish the job by monitors that change all the time, with slices that come last first."""
    while not farm.is_finished(job):
        with farm.monitor():
            held = [lease for lease in (farm.lease() for _ in range(6)) if lease]
            for lease in reversed(held):
                farm.commit(lease)
            if not held:
                until(
                    lambda: farm.is_finished(job) or take_census(farm.client).slices["waiting"] > 0
                )


def go_on(farm: NoiseFarm, job: Job, **changes: Any) -> Job:
    """The job that goes on with this one."""
    continuations = Continuations(farm.jobs._redis)
    remains = continuations.remains(job)
    spec = JobSpec.model_validate(changed_spec(job.spec, changes))
    assert lost_by(job, remains, spec) is None
    return continuations.start(job, remains, spec).job


def loses(farm: NoiseFarm, job: Job, **changes: Any) -> str | None:
    """Why a job with these changes cannot have the samples of this one."""
    spec = JobSpec.model_validate(changed_spec(job.spec, changes))
    return lost_by(job, Continuations(farm.jobs._redis).remains(job), spec)
