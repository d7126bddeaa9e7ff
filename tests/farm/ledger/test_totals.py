"""The farm's totals count each thing once, and a census costs what is open, not what ever was."""

import pytest
import redis

from plateau.farm.ledger.ownership import Ownership
from plateau.farm.ledger.queue import Lease, SliceQueue
from plateau.farm.ledger.totals import Demand, take_census
from plateau.farm.ledger.workers import MonitorLife
from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.redis.commands.sweeps import Forget
from plateau.farm.redis.scripts import Scripts
from tests.support.farms.ledger_farm import (
    LedgerFarm,
    about,
    commit,
    lease_scalar,
    live_on,
    record_of,
)
from tests.support.until import until

PIXELS = 8 * 4


class Farm(LedgerFarm):
    """Its slices have 25 spp, and take half a second."""

    def job(self, slices: int = 3, **spec: object) -> tuple[Job, Ownership]:
        return super().job(slices, slice_spp=25, **spec)

    def lease(self, worker: SliceQueue | None = None) -> Lease:
        return lease_scalar(worker or self.worker())

    def commit(self, held: Lease, blob: str = "partial") -> str:
        return commit(self.worker(), held, blob=blob, render_s=0.5)

    def tries(self) -> dict[str, int]:
        """How tries ended, where any did so."""
        return {end: count for end, count in take_census(self.client).tries.items() if count}


@pytest.fixture
def farm(client: redis.Redis) -> Farm:
    return Farm(client)


def test_of_an_empty_farm_all_is_zero(farm: Farm) -> None:
    census = take_census(farm.client)
    assert census.jobs == {"queued": 0, "rendering": 0, "paused": 0}
    assert census.slices == {"waiting": 0, "leased": 0}
    assert census.queue_age_s == 0
    assert set(census.tries.values()) == set(census.jobs_ended.values()) == {0}
    assert census.swept_at is None


class TestSlices:
    def test_count_once_however_often_they_are_committed(self, farm: Farm) -> None:
        farm.job()
        held = farm.lease()
        # If the answer was lost and the commit comes again
        assert [farm.commit(held), farm.commit(held)] == ["committed"] * 2
        assert farm.tries() == {"committed": 1}
        assert take_census(farm.client).samples == 25 * PIXELS
        assert take_census(farm.client).machine_s == 0.5
        # If it is another try of the slice
        farm.commit(held, blob="another")
        assert farm.tries() == {"committed": 1, "duplicate": 1}
        assert take_census(farm.client).samples == 25 * PIXELS
        assert take_census(farm.client).machine_s == 1.0

    def test_that_come_to_nothing_are_told_apart(self, farm: Farm) -> None:
        job, owned = farm.job(slices=6)
        worker = farm.worker()
        worker.died(farm.lease(), "SIGSEGV", 0.25)
        worker.hand_back(farm.lease(), 0.25, cause="the worker stops")
        worker.hand_back(farm.lease(), cause="no driver", unfit=True)
        committed = farm.lease()
        farm.commit(committed)
        farm.owners.reject(owned, record_of(committed, blob="partial", render_s=0.5), "it is gone")
        late = farm.lease()
        worker.fail(farm.lease(), "no such plugin")
        farm.commit(late)
        expected = ("died", "handed-back", "unfit", "committed", "rejected", "failed", "late")
        assert farm.tries() == dict.fromkeys(expected, 1)
        assert take_census(farm.client).machine_s == farm.jobs.get(job.id).machine_s == 1.5

    def test_cost_their_time_on_each_thread_of_their_worker(self, farm: Farm) -> None:
        job, _ = farm.job(slices=2)
        four = farm.worker("four", threads=4)
        four.died(farm.lease(four), "SIGSEGV", 0.5)
        farm.commit(farm.lease())  # by one thread
        four.fail(farm.lease(four), "no such plugin", 1.0)
        known = farm.jobs.get(job.id)
        assert known.machine_s == 2.0
        assert known.core_hours == pytest.approx((4 * 0.5 + 0.5 + 4 * 1.0) / 3600)

    def test_of_a_worker_that_fell_silent_are_lost(self, farm: Farm) -> None:
        farm.job(slices=1)
        farm.runs_out(farm.lease(farm.worker("silent")))
        farm.lease(farm.worker("other"))
        assert farm.tries() == {"lost": 1}

    def test_wait_for_a_worker_or_are_leased_to_one(self, farm: Farm) -> None:
        farm.job(slices=5)
        assert take_census(farm.client).slices == {"waiting": 5, "leased": 0}
        held = [farm.lease() for _ in range(3)]
        assert take_census(farm.client).slices == {"waiting": 2, "leased": 3}
        # If one is put back, and one committed
        farm.worker().hand_back(held[0], 0.1, cause="the worker stops")
        farm.commit(held[1])
        assert take_census(farm.client).slices == {"waiting": 3, "leased": 1}


class TestDemand:
    def test_of_a_job_that_anybody_may_begin_is_for_all_until_it_is_pinned(
        self, farm: Farm
    ) -> None:
        farm.job(slices=4)
        assert take_census(farm.client).demand_for(["cuda_ad_rgb"]) == Demand(waiting=4, leased=0)
        farm.lease()
        assert take_census(farm.client).demand_for(["cuda_ad_rgb"]) == Demand(waiting=0, leased=0)
        assert take_census(farm.client).demand_for(["scalar_rgb"]) == Demand(waiting=3, leased=1)

    def test_is_for_workers_of_the_pool_with_the_tags_that_a_job_requires(self, farm: Farm) -> None:
        farm.job(slices=1)
        farm.job(slices=2, pool="night", variant="scalar_rgb")
        farm.job(slices=4, pool="night", requires=("big", "new"))
        census = take_census(farm.client)
        assert census.demand_for(pool="default").waiting == 1
        assert census.demand_for(pool="night").waiting == 6
        assert census.demand_for(pool="night", tags=()).waiting == 2
        assert census.demand_for(pool="night", tags=["old", "big", "new"]).waiting == 6
        assert census.demand_for(pool="night", tags=["big"]).waiting == 2
        assert census.demand_for(["cuda_ad_rgb"], pool="night").waiting == 4
        assert census.demand_for().waiting == 7

    def test_of_a_farm_that_never_rendered_takes_a_second_for_each_slice(self, farm: Farm) -> None:
        farm.job(slices=3)
        assert take_census(farm.client).demand_for([]).work_s == 3

    def test_takes_as_long_as_the_slices_of_the_job_took(self, farm: Farm) -> None:
        _, owned = farm.job(slices=5)
        farm.commit(farm.lease())  # in half a second
        farm.lease()
        assert take_census(farm.client).demand_for([]).work_s == 2  # three that wait and one leased
        # If the monitor expects it to end after 41 slices
        farm.owners.plan(owned, range(6), expected_spp=41 * 25)
        demand = take_census(farm.client).demand_for([])
        assert (demand.left, demand.work_s) == (40, 20)
        # And another job begins, of which nothing is known yet
        farm.job(slices=2)
        assert take_census(farm.client).demand_for([]).work_s == 21

    def test_ends_with_what_may_be_leased_though_its_end_seems_far(self, farm: Farm) -> None:
        _, owned = farm.job(slices=2)
        farm.owners.plan(owned, range(2), expected_spp=1000)
        farm.commit(farm.lease())
        assert take_census(farm.client).demand_for([]).work_s == 0.5 * 39
        farm.lease()
        assert take_census(farm.client).demand_for([]).work_s == 0.5


class TestJobs:
    def test_are_counted_by_state(self, farm: Farm) -> None:
        for _ in range(2):
            farm.job()
        farm.lease()
        rendering, _ = farm.job(priority=1)
        farm.lease()
        farm.jobs.pause(rendering.id)
        assert take_census(farm.client).jobs == {"queued": 1, "rendering": 1, "paused": 1}

    def test_end_once(self, farm: Farm) -> None:
        job, owned = farm.job()
        for _ in range(2):
            farm.jobs.cancel(job.id)
        farm.owners.finish(owned, keeps_sums=False)
        census = take_census(farm.client)
        assert census.jobs_ended == {"converged": 0, "exhausted": 0, "cancelled": 1, "failed": 0}
        assert sum(census.jobs.values()) == 0
        # And that is remembered when the job itself is forgotten
        assert Scripts(farm.client).run(Forget(job=job.id, finished_for_ms=0)) == "forgotten"
        assert take_census(farm.client).jobs_ended["cancelled"] == 1

    @pytest.mark.parametrize("end", [JobState.CONVERGED, JobState.EXHAUSTED])
    def test_save_samples_where_they_converge(self, farm: Farm, end: JobState) -> None:
        job, owned = farm.job(max_spp=1000, step=50)
        for _ in range(3):
            farm.commit(farm.lease())
        farm.owners.append_point(owned, 50, {})
        farm.owners.end(owned, end, "rule", "the end")
        saved = (1000 - 50) * PIXELS if end is JobState.CONVERGED else 0
        assert take_census(farm.client).samples_saved == saved
        assert farm.client.hget(keys.job(job.id), "state") == end

    def test_queue_from_their_creation_to_their_first_slice(self, farm: Farm) -> None:
        old, _ = farm.job()
        age_s = 3600
        created_at = farm.jobs.now_ms() - age_s * 1000
        farm.client.hset(keys.job(old.id), "created_at", created_at)
        farm.job()
        assert age_s <= take_census(farm.client).queue_age_s < age_s + 60
        held = farm.lease()
        assert held.job_id == old.id
        assert take_census(farm.client).queue_age_s >= age_s  # nothing is rendered of it yet
        farm.commit(held)
        assert take_census(farm.client).queue_age_s < 60


def test_workers_are_counted_by_what_they_do(farm: Farm) -> None:
    jobs, full = {"a": None, "b": "0123456789ab", "c": "0123456789ab"}, {"c": "the disk is full"}
    for name, job in jobs.items():
        said = {**about(name), "job": job, "trouble": full.get(name)}
        farm.worker(name).heartbeat(said, ())
    live_on(farm.client, *"abc")
    assert take_census(farm.client).workers == {"idle": 1, "rendering": 1, "out_of_service": 1}
    # Silent ones are gone
    farm.client.zadd(keys.WORKERS, {"a": farm.jobs.now_ms() - 20_000})
    assert take_census(farm.client).workers["idle"] == 0


def test_a_monitor_counts_until_it_signs_off_or_falls_silent(farm: Farm) -> None:
    one, other = MonitorLife(farm.client, "m-1", 60), MonitorLife(farm.client, "m-2", 60)
    one.heartbeat(jobs=2)
    one.heartbeat(jobs=3)
    other.heartbeat(jobs=1)
    MonitorLife(farm.client, "m-3", lease_s=0.2).heartbeat(jobs=5)
    until(lambda: take_census(farm.client).monitors == 2)
    assert take_census(farm.client).jobs_owned == 4
    one.heartbeat(None)
    assert take_census(farm.client).jobs_owned == 1


def test_a_census_does_not_look_at_jobs_that_are_finished(farm: Farm) -> None:
    for _ in range(20):
        job, owned = farm.job(slices=1)
        farm.jobs.cancel(job.id)
        farm.owners.finish(owned, keeps_sums=False)
    for _ in range(3):
        farm.job(slices=1)
    farm.client.config_resetstat()
    take_census(farm.client)
    calls = {name: of["calls"] for name, of in farm.client.info("commandstats").items()}
    assert calls["cmdstat_hmget"] == 3
