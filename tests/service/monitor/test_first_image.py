"""Who follows a job is told once that there is an image, whichever is its first."""

from plateau.farm.ledger.continuation import Continuations
from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.faults.invariants import check_job
from tests.support.until import until


def finish(farm: NoiseFarm, job: Job) -> Job:
    until(lambda: farm.jobs.get(job.id).finished_at is not None)
    check_job(farm.jobs, farm.store, farm.jobs._redis, job.id)
    return farm.jobs.get(job.id)


def told(farm: NoiseFarm, job: Job) -> list[str]:
    """What happened to the job, but for its slices, in order: states by their names."""
    events = (event for event in farm.jobs.events(job.id) if event.type != "slice")
    return [str(event.data["to"]) if event.type == "state" else event.type for event in events]


def announced_spp(farm: NoiseFarm, job: Job) -> list[object]:
    return [event.data["spp"] for event in farm.jobs.events(job.id) if event.type == "image"]


def test_the_first_is_the_final_one_of_a_job_of_one_slice(farm: NoiseFarm) -> None:
    job = farm.submit(step=25, slice_spp=25, max_spp=25)
    with farm.monitor():
        farm.render(1)
        finish(farm, job)
    happened = "queued rendering point rendered exhausted image finished"
    assert told(farm, job) == happened.split()
    assert announced_spp(farm, job) == [25]


def test_the_first_is_the_final_one_of_a_job_that_was_cancelled_before_any(farm: NoiseFarm) -> None:
    # Given a job whose first slice comes when no monitor looks, and which is cancelled then
    job = farm.submit(step=100, slice_spp=25)
    with farm.monitor():
        lease = farm.next_lease()
    farm.commit(lease)
    assert farm.jobs.cancel(job.id).image_spp is None
    with farm.monitor():
        assert finish(farm, job).image_spp == 25
    assert told(farm, job) == ["queued", "rendering", "cancelled", "image", "finished"]
    assert announced_spp(farm, job) == [25]


def test_a_job_that_goes_on_from_sums_has_the_image_of_the_one_before(farm: NoiseFarm) -> None:
    with farm.monitor():
        job = farm.submit(step=25, slice_spp=25, max_spp=50)
        farm.render(2)
        finish(farm, job)
        continuations = Continuations(farm.jobs._redis)
        remains = continuations.remains(job := farm.jobs.get(job.id))
        assert not remains.kept
        spec = job.spec.model_copy(update={"max_spp": 75})
        after = continuations.start(job, remains, spec).job
        assert after.image_spp == 50
        assert announced_spp(farm, after) == [50]
        # Its own ones are no first any more
        farm.render(1)
        assert finish(farm, after).state is JobState.EXHAUSTED
    assert announced_spp(farm, after) == [50]
