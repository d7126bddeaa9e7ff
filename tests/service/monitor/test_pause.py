"""What the monitor does with a job that is paused: it keeps all of it, and goes on where it was."""

import pytest

from plateau.farm.blobs import names as blobs
from plateau.farm.images.exr import decode_image
from plateau.farm.ledger.queue import Lease
from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from plateau.service.monitor import turns
from tests.support.farms.every_time import save_every_time
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.faults.invariants import check_job
from tests.support.until import until

QUICK = {"step": 20, "slice_spp": 10, "max_spp": 4000, "rule": {"name": "reverse"}}


@pytest.fixture
def farm(farm: NoiseFarm, monkeypatch: pytest.MonkeyPatch) -> NoiseFarm:
    """A farm that saves and shows at once, and whose monitors look at their jobs all the time."""
    save_every_time(monkeypatch)
    monkeypatch.setattr(turns, "IDLE_S", 0.02)
    return farm


def work_up_to(farm: NoiseFarm, index: int) -> Lease:
    """Commit every slice before this one, and hold it."""
    held: list[Lease] = []

    def step() -> bool:
        lease = farm.lease()
        if lease is None:
            return False
        if lease.index == index:
            held.append(lease)
        else:
            farm.commit(lease)
        return bool(held)

    until(step)
    return held[0]


def outcome(farm: NoiseFarm, job: Job) -> tuple[object, ...]:
    """What a user has of a finished job; its invariants are checked."""
    done = farm.jobs.get(job.id)
    check_job(farm.jobs, farm.store, farm.jobs._redis, job.id)
    curve = [point.model_dump(exclude={"at"}) for point in farm.jobs.curve(job.id)]
    image = decode_image(farm.picture(job, "image.exr")).tobytes()
    return done.state, done.spp, done.verdict, curve, image


@pytest.fixture
def undisturbed(farm: NoiseFarm) -> Job:
    """A job that converged by itself."""
    job = farm.submit(**QUICK)
    with farm.monitor():
        farm.finish(job)
    return farm.jobs.get(job.id)


def test_pausing_at_every_point_changes_nothing(farm: NoiseFarm, undisturbed: Job) -> None:
    job = farm.submit(**QUICK)
    for index in range(1, undisturbed.spp // 10 - 1, 3):
        with farm.monitor():
            held = work_up_to(farm, index)
            farm.jobs.pause(job.id)
            farm.commit(held)
            if index % 2:  # until a checkpoint has all that is committed
                until(lambda: farm.store.names(blobs.partials(job.id)) == [])
                until(
                    lambda: (
                        f"{farm.jobs.get(job.id).committed_spp:07d}" in farm.jobs.results(job.id)
                    )
                )
            farm.jobs.resume(job.id)
    with farm.monitor():
        farm.finish(job)
    assert outcome(farm, job) == outcome(farm, undisturbed)


@pytest.mark.parametrize("is_watched", [True, False])
def test_the_last_slice_that_the_rule_waited_for_ends_a_paused_job(
    farm: NoiseFarm, undisturbed: Job, is_watched: bool
) -> None:
    job = farm.submit(**QUICK)
    with farm.monitor():
        # Given a job that is paused while the very slice is rendered by which it will converge
        held = work_up_to(farm, undisturbed.spp // 10 - 1)
        until(lambda: farm.jobs.get(job.id).points == undisturbed.points - 1)
        farm.jobs.pause(job.id)
        if is_watched:
            farm.commit(held)
            # Then nothing is left to be resumed
            until(lambda: farm.is_finished(job))
    if not is_watched:  # its monitor has died, and another finds the verdict
        farm.commit(held)
        assert farm.jobs.get(job.id).state is JobState.PAUSED
    with farm.monitor():
        until(lambda: farm.is_finished(job))
    assert outcome(farm, job) == outcome(farm, undisturbed)
    assert [line.split()[2] for line in farm.jobs.story(job.id)] == [
        "queued:",
        "rendering:",
        "paused:",
        "converged:",
    ]
