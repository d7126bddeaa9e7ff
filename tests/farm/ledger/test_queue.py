"""Slices are leased, kept, committed, given back and lost; each counts once."""

import pytest
import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.model.errors import FenceLost, UnreadableJob
from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from plateau.farm.process.waits import Stop
from plateau.farm.redis import keys
from plateau.farm.redis.wake import Wake
from tests.support.farms.ledger_farm import VARIANTS, LedgerFarm, commit, lease, own


@pytest.fixture
def farm(client: redis.Redis) -> LedgerFarm:
    return LedgerFarm(client)


def test_there_is_something_to_see_before_the_first_slice_is_there(farm: LedgerFarm) -> None:
    job, owned = farm.job()
    worker, other = farm.worker("w"), farm.worker("x")
    held = lease(worker)
    # Who has the slice may show its first pass, and the monitor hears of it
    hints = Wake(farm.client, keys.WAKE_MONITORS)
    hints.wait(0, Stop())
    assert not other.glimpse(held, "another's")
    assert farm.owners.glimpse(job.id) is None
    assert worker.glimpse(held, "a glimpse")
    assert farm.owners.glimpse(job.id) == "a glimpse"
    assert hints.wait(60, Stop()) == {job.id}
    assert farm.jobs.get(job.id).image_spp is None
    # Once there is an image it comes too late; the first image is announced, and only that
    for spp in (4, 25, 50):
        farm.owners.show_results(owned, blobs.result_set(job.id, spp, owned.token), spp)
        assert farm.jobs.get(job.id).image_spp == spp
    assert farm.owners.glimpse(job.id) is None
    assert not worker.glimpse(held, "again")
    announced = [one.data for one in farm.jobs.events(job.id) if one.type == "image"]
    assert announced == [{"spp": 4}]


def test_slices_come_in_order_and_the_first_lease_starts_the_job(farm: LedgerFarm) -> None:
    job, owned = farm.job(slices=3)
    farm.owners.plan(owned, range(2))  # which plans none, and takes none back
    worker = farm.worker("w")
    assert [lease(worker).index for _ in range(3)] == [0, 1, 2]
    assert worker.lease(VARIANTS, None, in_turn=False) is None
    started = farm.jobs.get(job.id)
    assert (started.state, started.variant) == (JobState.RENDERING, "llvm_ad_rgb")
    assert started.started_at is not None


def test_a_lease_that_is_not_renewed_goes_to_another_worker(farm: LedgerFarm) -> None:
    farm.job(slices=1)
    slow, quick = farm.worker("slow"), farm.worker("quick")
    first = lease(slow)
    assert quick.lease(VARIANTS, None, in_turn=False) is None
    farm.runs_out(first)
    second = lease(quick)
    assert (second.index, second.tries) == (first.index, 2)
    # The zombie comes back: its heartbeat says that the slice is not its own any more
    assert slow.heartbeat({}, (first,)) == (first,)
    # A slice is the same from both, so whoever commits it first has done it
    assert commit(slow, first) == "committed"
    assert commit(quick, second, blob="another") == "duplicate"
    assert quick.heartbeat({}, (second,)) == (second,)


def test_a_worker_that_cannot_read_a_job_leaves_it_to_others(farm: LedgerFarm) -> None:
    job, _ = farm.job()
    spec = farm.client.hget(keys.job(job.id), "spec")
    farm.client.hset(keys.job(job.id), "spec", spec.replace("reverse", "of-another-plateau"))
    old, new = farm.worker("old"), farm.worker("new")
    with pytest.raises(UnreadableJob, match=job.id):
        lease(old)
    assert old.lease(VARIANTS, None, in_turn=False) is None
    farm.client.hset(keys.job(job.id), "spec", spec)
    assert lease(new).tries == 1


def test_a_worker_that_is_lost_before_any_commit_binds_nobody_to_its_variant(
    farm: LedgerFarm,
) -> None:
    job, _ = farm.job(slices=1)
    lost, other = farm.worker("lost"), farm.worker("other")
    held = lease(lost, variants=("cuda_ad_rgb", "llvm_ad_rgb"))
    assert farm.jobs.get(job.id).variant == held.variant == "cuda_ad_rgb"
    assert other.lease(VARIANTS, None, in_turn=False) is None
    farm.runs_out(held)
    taken = lease(other)
    assert taken.variant == "llvm_ad_rgb"
    assert commit(lost, held) == "stale"
    # One that comes back before another came is no zombie
    farm.runs_out(taken)
    assert farm.worker("far", pool="far").lease(VARIANTS, None, in_turn=False) is None
    assert commit(other, taken) == "committed"
    assert farm.jobs.get(job.id).variant == "llvm_ad_rgb"


def test_nobody_is_robbed_or_blamed_when_the_whole_farm_was_cut_off(farm: LedgerFarm) -> None:
    job, _ = farm.job(slices=1)
    cut_off, other = farm.worker("cut off"), farm.worker("other")
    held = lease(cut_off)
    cut_off.heartbeat({}, (held,))
    # Given that Redis heard of no worker at all for longer than a lease
    farm.runs_out(held)
    farm.client.hset(keys.HEARD, "at", 1)
    # Then the first that reaches it again does not get the slice of the one that could not renew
    assert other.lease(VARIANTS, None, in_turn=False) is None
    assert cut_off.heartbeat({}, (held,)) == ()
    # But one that stays away loses it a lease later
    farm.client.hdel(keys.HEARD, "spared_till")
    farm.runs_out(held)
    assert lease(other).tries == 2
    assert troubles(farm, job) == ["worker cut off was lost"]


def test_a_slice_that_was_committed_late_is_not_rendered_again(farm: LedgerFarm) -> None:
    job, owned = farm.job(slices=1)
    slow, quick = farm.worker("slow"), farm.worker("quick")
    late = lease(slow)
    commit(slow, late)
    # Given a slice that was rejected and planned again, and whose zombie commits it once more
    (record,) = farm.owners.committed(job.id, range(1))
    assert farm.owners.reject(owned, record, "spoiled") == 1
    assert farm.owners.reject(owned, record, "spoiled") == 0  # the answer was lost: no harm
    assert farm.jobs.get(job.id).committed_spp == 0
    assert commit(slow, late, blob="again") == "committed"
    # Then nobody gets it any more
    assert quick.lease(VARIANTS, None, in_turn=False) is None
    assert farm.client.xlen(keys.job(job.id, "slices")) == 0
    assert list(farm.jobs.ledger(job.id)) == [0]


def troubles(farm: LedgerFarm, job: Job) -> list[object]:
    return [event.data["cause"] for event in farm.jobs.events(job.id) if event.type == "trouble"]


def test_heartbeats_keep_a_lease(farm: LedgerFarm) -> None:
    farm.job(slices=1)
    worker, other = farm.worker("w"), farm.worker("other")
    held = lease(worker)
    for _ in range(4):
        farm.runs_out(held)
        assert worker.heartbeat({}, (held,)) == ()
        assert other.lease(VARIANTS, None, in_turn=False) is None
    assert commit(worker, held) == "committed"


def test_a_slice_handed_back_is_taken_at_once_and_counts_no_try(farm: LedgerFarm) -> None:
    farm.job(slices=1)
    worker, other = farm.worker("w"), farm.worker("other")
    for _ in range(5):
        worker.hand_back(lease(worker))
    assert lease(other).tries == 1


def test_the_third_death_on_a_slice_poisons_the_job(farm: LedgerFarm) -> None:
    job, _ = farm.job(slices=2)
    assert farm.worker("a").died(lease(farm.worker("a")), "SIGSEGV", 1.0) == "put back"
    farm.runs_out(lease(farm.worker("b")))  # it dies without a word
    held = lease(farm.worker("c"))
    assert held.tries == 3
    assert farm.worker("c").died(held, "SIGABRT", 1.0) == "poisoned"
    failed = farm.jobs.get(job.id)
    assert failed.state is JobState.FAILED
    assert failed.reason == (
        "slice 0 failed 3 times; each time the process that rendered it ended: SIGSEGV; "
        "worker b was lost; SIGABRT"
    )
    assert failed.machine_s == 2.0
    assert (failed.ended_by, failed.failed_slice) == ("deaths", 0)


def test_a_scene_at_fault_fails_the_job_at_once(farm: LedgerFarm) -> None:
    job, _ = farm.job(slices=2)
    lease(farm.worker("a"))
    farm.worker("b").fail(lease(farm.worker("b")), "slice 7 failed 3 times: no such plugin")
    failed = farm.jobs.get(job.id)
    assert (failed.ended_by, failed.failed_slice) == ("scene", 1)


def test_three_silent_deaths_poison_the_job_too(farm: LedgerFarm) -> None:
    job, _ = farm.job(slices=1)
    for name in "abc":
        farm.runs_out(lease(farm.worker(name)))
    assert farm.worker("d").lease(VARIANTS, None, in_turn=False) is None
    assert "worker c was lost" in farm.jobs.get(job.id).reason


def lost_one_after_the_other(farm: LedgerFarm, job: Job, most: int) -> int:
    """Cut off a worker, till another has its slice, then the next; each is heard of again then.

    Returns how many the job survived of so many.
    """
    previous = None
    for number in range(most):
        worker = farm.worker(f"cut off {number}")
        worker.heartbeat({"variants": VARIANTS}, ())
        held = worker.lease(VARIANTS, None, in_turn=False)
        if held is None:
            assert farm.jobs.get(job.id).state.ended
            return number
        if previous is not None:
            previous.heartbeat({"variants": VARIANTS}, ())
        farm.runs_out(held)
        previous = worker
    return most


def test_a_slice_is_not_forgiven_for_ever(farm: LedgerFarm) -> None:
    job, _ = farm.job(slices=1)
    assert lost_one_after_the_other(farm, job, 20) == 13
    assert "worker cut off 12 was lost" in farm.jobs.get(job.id).reason


def test_overlapping_seeds_are_refused(farm: LedgerFarm) -> None:
    farm.job()
    worker = farm.worker("w")
    first, second = lease(worker), lease(worker)
    assert commit(worker, first, seeds=(10, 12)) == "committed"
    assert commit(worker, second, seeds=(8, 10)) == "overlap"
    assert commit(worker, second, seeds=(12, 14)) == "overlap"
    assert commit(worker, second, seeds=(13, 15)) == "committed"


def test_cancelling_withdraws_everything_at_once(farm: LedgerFarm) -> None:
    job, owned = farm.job()
    worker = farm.worker("w")
    held = lease(worker)
    assert farm.jobs.cancel(job.id).state is JobState.CANCELLED
    assert farm.jobs.cancel(job.id).state is JobState.CANCELLED  # again is harmless
    assert not farm.client.exists(keys.job(job.id, "slices"))
    assert worker.lease(VARIANTS, None, in_turn=False) is None
    assert worker.heartbeat({}, (held,)) == (held,)
    assert commit(worker, held) == "ended"
    farm.owners.plan(owned, range(8))
    assert not farm.client.exists(keys.job(job.id, "slices"))


def test_a_monitor_that_lost_its_job_can_write_nothing(farm: LedgerFarm) -> None:
    # Given a monitor whose ownership has run out, and another that took over
    job, old = farm.job()
    farm.client.delete(keys.job(job.id, "owner"))
    new = own(farm.owners, job.id)
    assert new.token != old.token
    # Then the old one's writes are all refused
    for write in (
        lambda: farm.owners.plan(old, range(9)),
        lambda: farm.owners.append_point(old, 100, {"spp": 100}),
        lambda: farm.owners.show_results(old, "x", 25),
        lambda: farm.owners.conclude(old, spp=9, results="x", notes=()),
        lambda: farm.owners.end(old, JobState.CONVERGED, "rule", "x"),
        lambda: farm.owners.finish(old, keeps_sums=False),
        lambda: farm.owners.abandon(old),
    ):
        with pytest.raises(FenceLost):
            write()
    assert farm.owners.renew((old, new)) == {job.id}
    assert farm.jobs.get(job.id).points == 0


def test_a_job_that_redis_has_lost_is_given_to_nobody(farm: LedgerFarm) -> None:
    lost, owned = farm.job(priority=1)
    other, _ = farm.job()
    assert lease(farm.worker("w")).job_id == lost.id
    # Given that its hash is gone, and its owner has noticed
    farm.client.delete(keys.job(lost.id))
    farm.owners.abandon(owned)
    assert farm.owners.unfinished() == {other.id}
    # Then workers get other jobs, whatever was waiting, leased or late of this one
    given = [lease(farm.worker(name)).job_id for name in "wxyz"]
    assert given == [other.id] * 4
    assert farm.worker("w").lease(VARIANTS, None, in_turn=False) is None


def test_a_job_whose_state_is_there_is_not_lost(farm: LedgerFarm) -> None:
    job, owned = farm.job()
    farm.owners.abandon(owned)
    assert farm.owners.unfinished() == {job.id}
    assert lease(farm.worker("w")).job_id == job.id


def test_the_ledger_is_read_as_a_prefix(farm: LedgerFarm) -> None:
    job, _ = farm.job(slices=4)
    worker = farm.worker("w")
    held = [lease(worker) for _ in range(4)]
    for index in (0, 1, 3):
        commit(worker, held[index])
    assert [record.index for record in farm.owners.committed(job.id, range(4))] == [0, 1]
    assert [record.index for record in farm.owners.committed(job.id, range(3, 8))] == [3]
