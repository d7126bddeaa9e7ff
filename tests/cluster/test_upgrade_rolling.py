"""A farm is upgraded under load, one process after the other, and nobody notices."""

from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import pytest

from plateau.farm.ledger.totals import take_census
from plateau.farm.redis import keys
from tests.cluster.support_upgrade import Member, People, UpgradedFarm
from tests.support.farms.faulty_farm import SPEC
from tests.support.faults.invariants import assert_same, outcome
from tests.support.until import until


@pytest.fixture
def farm(tmp_path: Path, cache: Path) -> Iterator[UpgradedFarm]:
    with UpgradedFarm(tmp_path, cache) as farm:
        yield farm


def test_a_rolling_restart_loses_nothing(
    farm: UpgradedFarm, form: Literal["short", "long"]
) -> None:
    workers, rounds = (2, 1) if form == "short" else (3, 2)
    # Given a farm of two APIs, two monitors and some workers, and what comes of a job
    farm.begin(monitors=2, workers=workers)
    undisturbed = outcome(farm, farm.submit(**SPEC).id)
    before = take_census(farm.redis_client)
    # If every process is stopped and started again, while people submit jobs and watch them
    with People(farm.urls) as people:
        for _ in range(rounds):
            for member in farm.members:
                took_s = farm.restart(member)
                print(f"{member.role}: stopped in {took_s:.1f} s")
    # Then none of their calls has failed for good
    assert people.troubles == []
    # And each submission that was acknowledged is there, once
    ids = [one.job_id for one in people.watched]
    print(f"{len(ids)} jobs meanwhile")
    assert len(ids) >= 2 * rounds
    assert farm.redis_client.zcard(keys.JOBS) == len(set(ids)) + 1
    for one in people.watched:
        # And came to the end that it would have come to, with the same image to the bit
        assert_same(outcome(farm, one.job_id), undisturbed)
        # And who watched it was told all that happened, once, in order
        assert [event.id for event in one.events] == [
            event.id for event in farm.jobs.events(one.job_id)
        ]
        assert one.points == [point.spp for point in farm.jobs.curve(one.job_id)]
    # And no worker left its slice to run out: it finished it, or gave it back
    tries = take_census(farm.redis_client).tries
    for end in ("lost", "died", "rejected", "unfit", "failed"):
        assert tries[end] == before.tries[end], f"{end}: {tries}"


def test_a_slice_that_takes_long_is_given_back_and_taken_at_once(farm: UpgradedFarm) -> None:
    farm.begin(monitors=1, workers=2)
    # Given a job of one slice, which one of two workers has for long
    size = {"width": 128, "height": 128}
    spec = {"parameters": size, "step": 4096, "slice_spp": 4096, "max_spp": 4096}
    job = farm.submit(**spec, rule={"name": "fixed", "spp": 4096})
    until(lambda: holder(farm, job.id) is not None)
    first = holder(farm, job.id)
    # If that one is asked to stop
    assert first is not None
    farm.stop(first)
    # Then the other has the slice: nobody waited for the 15 s of a lease
    until(lambda: holder(farm, job.id) not in {None, first}, 10)
    assert [one.what for one in farm.jobs.log(job.id)] == ["handed-back"]
    farm.client.cancel(job.id)
    until(lambda: farm.jobs.get(job.id).finished_at is not None)


def test_a_monitor_that_stops_has_its_jobs_taken_over_at_once(farm: UpgradedFarm) -> None:
    farm.begin(monitors=2, workers=0)
    job = farm.submit(**SPEC)
    owner, sealed = keys.job(job.id, "owner"), keys.job(job.id, "sealed")
    until(lambda: farm.redis_client.exists(owner))
    # If each monitor is stopped in turn, whichever owns the job
    for member in [one for one in farm.members if one.role == "monitor"]:
        farm.restart(member)
    # Then it has an owner all the same, long before a lease of 15 s has run out
    until(lambda: farm.redis_client.exists(owner), 10)
    assert int(str(farm.redis_client.hget(sealed, "fence") or 0)) >= 2
    farm.client.cancel(job.id)
    until(lambda: farm.jobs.get(job.id).finished_at is not None)


def holder(farm: UpgradedFarm, job_id: str) -> Member | None:
    """The worker that has a slice of the job."""
    if not farm.redis_client.exists(slices := keys.job(job_id, "slices")):
        return None
    pending = farm.redis_client.xpending_range(slices, keys.GROUP, "-", "+", 1)
    names = [one["consumer"] for one in pending]
    for member in farm.members:
        if any(f"-{member.process.pid}-" in name for name in names):
            return member
    return None
