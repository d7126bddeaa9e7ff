"""A paused job is leased to nobody and loses nothing."""

import itertools

import pytest
import redis

from plateau.farm.ledger.queue import Lease
from plateau.farm.model.errors import IllegalTransition
from plateau.farm.model.job import Job
from plateau.farm.model.states import JOB_MOVES, JobState
from plateau.farm.redis import keys
from tests.support.farms.ledger_farm import LedgerFarm

POINT = {"visible_pixels": 3, "visible_fraction": 0.1, "slope": None}
ESTIMATE = {"estimate_pixels": 9.0, "estimate_fraction": 0.1}


class Farm(LedgerFarm):
    """Its jobs are of three slices, which any worker is given."""

    def lease(self) -> Lease | None:
        return self.worker().lease(("scalar_rgb",), None, in_turn=False)

    def moves(self, job: Job, **seconds: float) -> None:
        """Such a moment of the job was so much earlier."""
        for moment, ago_s in seconds.items():
            self.client.hincrbyfloat(keys.job(job.id), moment, -1000 * ago_s)


@pytest.fixture
def farm(client: redis.Redis) -> Farm:
    return Farm(client)


@pytest.mark.parametrize(
    ("start", "call"), list(itertools.product(JobState, ("pause", "resume"))), ids=str
)
def test_every_state_is_paused_and_resumed_along_the_table(
    farm: Farm, start: JobState, call: str
) -> None:
    target = {"pause": JobState.PAUSED, "resume": JobState.RENDERING}[call]
    job, _ = farm.job()
    farm.client.hset(keys.job(job.id), "state", start.value)
    before = farm.jobs.events(job.id)
    if start is target:  # said again: nothing happens
        assert getattr(farm.jobs, call)(job.id).state is target
        assert farm.jobs.events(job.id) == before
    elif {start, target} == {JobState.RENDERING, JobState.PAUSED}:
        assert target in JOB_MOVES[start]
        assert getattr(farm.jobs, call)(job.id).state is target
    else:  # and it is a lease that starts a queued job, not a user
        with pytest.raises(IllegalTransition, match=r"(?s)cannot become .*queued: created"):
            getattr(farm.jobs, call)(job.id)
        assert farm.jobs.get(job.id).state is start


def test_a_job_that_starts_anew_starts_its_clock_anew(farm: Farm) -> None:
    job, _ = farm.job()
    held = farm.lease()
    assert held is not None
    # Given that its first worker found, while the job was paused, that it can render nothing
    farm.jobs.pause(job.id)
    farm.worker().hand_back(held, unfit=True, cause="no LLVM")
    farm.moves(job, started_at=1)
    resumed = farm.jobs.resume(job.id)
    assert resumed.variant is None
    # Then the time limit counts from the lease by which it starts again
    farm.lease()
    started = farm.jobs.get(job.id)
    assert started.started_at is not None
    assert resumed.started_at is not None
    assert started.started_at > resumed.started_at
    assert started.paused_s == 0


def test_a_paused_job_can_be_cancelled_and_can_fail(farm: Farm) -> None:
    cancelled, _ = farm.job()
    farm.lease()
    farm.jobs.pause(cancelled.id)
    assert farm.jobs.cancel(cancelled.id).paused_at is None
    failed, _ = farm.job()
    held = farm.lease()
    assert held is not None
    farm.jobs.pause(failed.id)
    farm.worker().fail(held, "no such plugin")
    assert farm.jobs.get(failed.id).state is JobState.FAILED


def test_pauses_add_up_and_the_one_that_lasts_is_dated(farm: Farm) -> None:
    job, _ = farm.job()
    farm.lease()
    for _ in range(2):
        paused = farm.jobs.pause(job.id)
        assert paused.paused_at is not None
        assert farm.jobs.pause(job.id).paused_at == paused.paused_at  # said again
        farm.moves(job, paused_at=50)
        resumed = farm.jobs.resume(job.id)
    assert resumed.paused_at is None
    assert 100 <= resumed.paused_s < 150
    # An end ends the pause too
    farm.jobs.pause(job.id)
    farm.moves(job, paused_at=50)
    assert farm.jobs.cancel(job.id).paused_s >= resumed.paused_s + 50


def test_a_pause_does_not_put_off_the_expected_end(farm: Farm) -> None:
    job, owned = farm.job()
    farm.lease()
    farm.jobs.pause(job.id)
    # Given that it has rendered for 100 s, and is paused for 1000 s by now
    farm.moves(job, started_at=1100, paused_at=1000)
    # A point that comes while the job is paused, of slices that were in hand
    farm.owners.append_point(owned, 100, {"spp": 100, **POINT, **ESTIMATE, "expected_spp": 200})
    expected_s = farm.jobs.get(job.id).expected_s
    assert expected_s is not None
    assert 99 <= expected_s < 200
    # and it stays so, however long the pause
    farm.jobs.resume(job.id)
    assert farm.jobs.get(job.id).expected_s == expected_s
