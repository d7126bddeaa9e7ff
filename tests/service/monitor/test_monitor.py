"""The monitor brings a job to its end, whatever happens to it on the way."""

import threading
import time
from itertools import chain, repeat
from pathlib import Path

import numpy as np
import pytest
import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.read_ahead import SLOW_S
from plateau.farm.blobs.store import Blobs
from plateau.farm.images.exr import decode_image
from plateau.farm.ledger.ownership import Ownerships
from plateau.farm.ledger.queue import Lease
from plateau.farm.model.job import CurvePoint, Job
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.service.monitor.result_sets import ResultSets
from tests.support.farms.every_time import save_every_time
from tests.support.farms.noise_farm import SIZE, NoiseFarm, noise_film
from tests.support.until import until

QUICK = {"step": 20, "slice_spp": 10, "max_spp": 4000, "rule": {"name": "reverse"}}


def work(farm: NoiseFarm, job: Job, *, until_points: int | None = None) -> Job:
    """Commit slices as they are planned, until the job is finished or has so many points."""
    if until_points is None:
        return farm.finish(job)
    farm.work(lambda: farm.jobs.get(job.id).points >= until_points)
    return farm.jobs.get(job.id)


def leases_after_a_point(farm: NoiseFarm, job: Job, count: int = 1) -> list[Lease]:
    """Slices of the job, leased after its first point; its monitor has gone then."""
    with farm.monitor():
        farm.render(2)
        until(lambda: farm.jobs.get(job.id).points == 1)
        return [farm.next_lease() for _ in range(count)]


def judged(curve: list[CurvePoint]) -> list[dict[str, object]]:
    return [point.model_dump(exclude={"at"}) for point in curve]


def test_a_noisy_ramp_converges(farm: NoiseFarm) -> None:
    job = farm.submit(**QUICK, watch=[{"name": "fixed", "spp": 100}])
    with farm.monitor():
        done = work(farm, job)
    # It ended by the rule, below the cap, and says so with its numbers
    assert done.state is JobState.CONVERGED
    assert "levelled off" in done.reason
    assert done.verdict is not None
    assert done.spp < done.spec.max_spp
    assert done.samples_saved == (4000 - done.spp) * SIZE[0] * SIZE[1]
    # The curve has a point at each step, and where the watched rule would have stopped
    curve = farm.jobs.curve(job.id)
    assert [point.spp for point in curve] == list(range(20, done.spp + 1, 20))
    assert [point.rules["fixed"].stop for point in curve] == [p.spp >= 100 for p in curve]
    assert curve[-1].rules["reverse"].stop
    # The image is the sum of the prefix
    films = sum(noise_film(i, 10, 1.0).astype(np.float64) for i in range(done.spp // 10))
    image = decode_image(farm.picture(job, "image.exr"))
    np.testing.assert_array_equal(image, (films[..., :3] / films[..., 3:]).astype(np.float32))
    # And nothing else is left but its sums, from which another job could go on
    assert farm.store.names(blobs.partials(job.id)) == []
    (sums,) = farm.store.names(blobs.checkpoints(job.id))
    assert f"{done.spp:07d}" in sums
    assert farm.jobs.events(job.id)[-1].type == "finished"


def test_another_monitor_takes_over_and_changes_nothing(
    farm: NoiseFarm, client: redis.Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_every_time(monkeypatch)
    undisturbed = farm.submit(**QUICK)
    with farm.monitor():
        expected = work(farm, undisturbed)
    # Given a job whose monitor goes away again and again
    disturbed = farm.submit(**QUICK)
    points = 0
    while farm.jobs.get(disturbed.id).finished_at is None:
        with farm.monitor():
            points += 3
            work(farm, disturbed, until_points=min(points, expected.points))
            if points >= expected.points:
                work(farm, disturbed)
    # Then its curve and its image are those of the other
    assert judged(farm.jobs.curve(disturbed.id)) == judged(farm.jobs.curve(undisturbed.id))
    images = [decode_image(farm.picture(job, "image.exr")) for job in (undisturbed, disturbed)]
    np.testing.assert_array_equal(*images)
    assert (
        int(str(client.hget(keys.job(disturbed.id, "sealed"), "fence"))) > 2
    )  # it did change hands


def test_results_are_written_though_the_monitor_died_after_the_verdict(
    farm: NoiseFarm, client: redis.Redis
) -> None:
    job = farm.submit(**QUICK)
    with farm.monitor():
        done = work(farm, job)
    again = farm.submit(**QUICK)
    with farm.monitor():
        farm.render(2 * (done.points - 1))  # another two, and it would converge
        until(lambda: farm.jobs.get(again.id).points == done.points - 1)
    # Given a job that has ended with more in its ledger than was judged, and no results yet
    client.hset(keys.job(again.id), mapping={"state": "converged", "spp": 40})
    with farm.monitor():
        until(lambda: farm.jobs.get(again.id).finished_at is not None)
    # Then the image is the one that was judged
    films = sum(noise_film(i, 10, 1.0).astype(np.float64) for i in range(4))
    image = decode_image(farm.picture(again, "image.exr"))
    np.testing.assert_array_equal(image, (films[..., :3] / films[..., 3:]).astype(np.float32))


def test_a_job_that_does_not_converge_is_exhausted_at_its_cap(farm: NoiseFarm) -> None:
    farm.sigma = 30
    job = farm.submit(step=20, slice_spp=10, max_spp=130)
    with farm.monitor():
        done = work(farm, job)
    assert done.state is JobState.EXHAUSTED
    assert "cap of 130 spp" in done.reason
    assert done.samples_saved == 0
    assert [point.spp for point in farm.jobs.curve(job.id)] == [20, 40, 60, 80, 100, 120, 130]


def test_a_time_limit_exhausts_a_job_and_keeps_its_samples(farm: NoiseFarm) -> None:
    job = farm.submit(**QUICK, time_limit_s=1.5)
    # And two that no worker takes, of which one's limit counts from its submission
    patient = farm.submit(**QUICK, time_limit_s=0.5, priority=-1)
    late = farm.submit(**QUICK, time_limit_s=0.5, time_limit_from="submission", priority=-1)
    with farm.monitor():
        farm.render(1)
        until(lambda: farm.is_finished(late))
        until(lambda: farm.jobs.get(job.id).finished_at is not None)
    done = farm.jobs.get(job.id)
    assert (done.state, done.spp) == (JobState.EXHAUSTED, 10)
    assert "time limit of 1.5 s" in done.reason
    assert farm.picture(job, "image.png")
    done = farm.jobs.get(late.id)
    assert (done.state, done.spp) == (JobState.FAILED, 0)
    assert done.reason == "no slice of it was rendered within its time limit of 0.5 s"
    assert farm.jobs.get(patient.id).state is JobState.QUEUED


def test_a_job_keeps_its_slices_where_asked(
    farm: NoiseFarm, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_every_time(monkeypatch)
    with farm.monitor():
        done = work(farm, farm.submit(**QUICK, keep_slices=True))
    kept = farm.store.names(blobs.partials(done.id))
    assert len(kept) == len(farm.jobs.ledger(done.id)) >= done.spp // 10
    assert farm.store.names(blobs.checkpoints(done.id)) == []


def spoil(farm: NoiseFarm, lease: Lease) -> None:
    """Change a byte of a committed partial."""
    blob = farm.jobs.ledger(lease.job_id)[lease.index]["blob"]
    farm.store.put(blob, farm.store.get(blob)[:-1] + b"?")


def truncate(farm: NoiseFarm, lease: Lease) -> None:
    blob = farm.jobs.ledger(lease.job_id)[lease.index]["blob"]
    farm.store.put(blob, farm.store.get(blob)[:100])


def lose(farm: NoiseFarm, lease: Lease) -> None:
    farm.store.delete(farm.jobs.ledger(lease.job_id)[lease.index]["blob"])


def test_a_partial_that_is_lost_or_spoiled_is_rendered_again(farm: NoiseFarm) -> None:
    undisturbed = farm.submit(**QUICK)
    with farm.monitor():
        work(farm, undisturbed)
    disturbed = farm.submit(**QUICK)
    leases = leases_after_a_point(farm, disturbed, 3)
    # Given slices that were committed while no monitor looked, and harmed before one does
    for lease, harm in zip(leases, (spoil, truncate, lose), strict=True):
        farm.commit(lease)
        harm(farm, lease)
    with farm.monitor():
        done = work(farm, disturbed)
    # Then they are rendered again: same curve, same image, and the ledger has each once
    assert judged(farm.jobs.curve(disturbed.id)) == judged(farm.jobs.curve(undisturbed.id))
    images = [decode_image(farm.picture(job, "image.exr")) for job in (undisturbed, disturbed)]
    np.testing.assert_array_equal(*images)
    assert done.committed_spp == 10 * len(farm.jobs.ledger(disturbed.id))
    # And the job's events say so
    told = [trouble["index"] for trouble in troubles(farm, disturbed)]
    assert told == [lease.index for lease in leases]


def troubles(farm: NoiseFarm, job: Job) -> list[dict[str, object]]:
    return [event.data for event in farm.jobs.events(job.id) if event.type == "trouble"]


def test_a_partial_that_never_comes_back_whole_fails_its_job_and_no_other(
    farm: NoiseFarm, client: redis.Redis
) -> None:
    bad = farm.submit(**QUICK)
    with farm.monitor():
        until(lambda: client.hget(keys.job(bad.id), "planned") != "0")
    for time_ in range(1, 5):
        while (lease := farm.lease()) is not None:
            farm.commit(lease)
            spoil(farm, lease)
        with farm.monitor():
            until(lambda time_=time_: len(troubles(farm, bad)) == time_)
            if time_ == 4:
                until(lambda: farm.jobs.get(bad.id).finished_at is not None)
    assert farm.jobs.get(bad.id).state is JobState.FAILED
    assert "never came back whole" in farm.jobs.get(bad.id).reason
    with farm.monitor():
        assert work(farm, farm.submit(**QUICK)).state is JobState.CONVERGED


@pytest.mark.parametrize(("harm", "keep_slices"), [("lost", True), ("spoiled", False)])
def test_a_checkpoint_that_is_lost_or_spoiled_costs_work_and_nothing_else(
    farm: NoiseFarm, monkeypatch: pytest.MonkeyPatch, harm: str, keep_slices: bool
) -> None:
    save_every_time(monkeypatch)
    undisturbed = farm.submit(**QUICK, keep_slices=keep_slices)
    with farm.monitor():
        expected = work(farm, undisturbed)
    disturbed = farm.submit(**QUICK, keep_slices=keep_slices)
    with farm.monitor():
        farm.render(2 * (expected.points - 2))  # and no more: the monitor would go on
        until(lambda: farm.jobs.get(disturbed.id).points == expected.points - 2)
    (checkpoint,) = farm.store.names(blobs.checkpoints(disturbed.id))
    if harm == "lost":
        farm.store.delete(checkpoint)
    else:
        farm.store.put(checkpoint, farm.store.get(checkpoint)[:-9] + b"corrupted")
    with farm.monitor():
        work(farm, disturbed)
    assert judged(farm.jobs.curve(disturbed.id)) == judged(farm.jobs.curve(undisturbed.id))
    images = [decode_image(farm.picture(job, "image.exr")) for job in (undisturbed, disturbed)]
    np.testing.assert_array_equal(*images)


def test_a_blob_store_that_fails_one_job_does_not_hold_up_the_others(farm: NoiseFarm) -> None:
    stuck = farm.submit(**QUICK)
    (lease,) = leases_after_a_point(farm, stuck)
    # Given a committed partial that cannot be read for now
    farm.commit(lease)
    unreadable = Path(farm.store.where) / farm.jobs.ledger(stuck.id)[lease.index]["blob"]
    content = unreadable.read_bytes()
    unreadable.unlink()
    unreadable.symlink_to(unreadable)  # which root cannot read either
    with farm.monitor():
        other = farm.submit(**QUICK, priority=1)
        assert work(farm, other).state is JobState.CONVERGED
        assert farm.jobs.get(stuck.id).state is JobState.RENDERING
        # When it can be read again, the job goes on
        unreadable.unlink()
        unreadable.write_bytes(content)
        assert work(farm, stuck).state is JobState.CONVERGED


def test_results_that_cannot_be_written_do_not_hold_the_monitor(
    farm: NoiseFarm, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise ValueError("no picture of this")

    monkeypatch.setattr(ResultSets, "_pictures", refuse)
    with farm.monitor():
        done = work(farm, farm.submit(**QUICK))
    assert done.state is JobState.FAILED
    assert "no picture of this" in done.reason
    assert farm.store.names(blobs.results(done.id)) == []


def test_a_picture_that_cannot_be_stored_costs_no_evaluation(farm: NoiseFarm) -> None:
    # Given a job that is judged at every slice, and a store that refuses its pictures for a while
    job = farm.submit(step=25, max_spp=50, rule={"name": "fixed", "spp": 50})
    refusal = Path(farm.store.where) / blobs.results(job.id)
    refusal.parent.mkdir(parents=True)
    refusal.touch()
    with farm.monitor():
        farm.render(1)
        until(lambda: farm.jobs.get(job.id).points == 1, 60)
        refusal.unlink()
        done = work(farm, job)
    assert (done.state, done.spp) == (JobState.CONVERGED, 50)
    assert [point.spp for point in farm.jobs.curve(job.id)] == [25, 50]


def test_slices_of_two_sizes_fail_the_job(farm: NoiseFarm) -> None:
    job = farm.submit(**QUICK)
    with farm.monitor():
        sizes = chain([(4, 4, 4)], repeat((5, 4, 4)))

        def step() -> bool:
            lease = farm.lease()
            if lease is not None:
                farm.commit(lease, np.ones(next(sizes), np.float32))
            return farm.jobs.get(job.id).state.ended

        until(step)
    assert "slice 1 is 4×5 pixels" in farm.jobs.get(job.id).reason


def test_a_black_image_stops_and_says_why(farm: NoiseFarm) -> None:
    job = farm.submit(**QUICK)
    black = np.zeros((*SIZE, 4), np.float32)
    black[..., 3] = 10
    with farm.monitor():

        def step() -> bool:
            lease = farm.lease()
            if lease is not None:
                farm.commit(lease, black)
            return farm.jobs.get(job.id).finished_at is not None

        until(step)
    done = farm.jobs.get(job.id)
    assert done.state is JobState.CONVERGED
    assert "nothing has changed visibly" in done.reason


def test_work_in_flight_is_bounded(farm: NoiseFarm, client: redis.Redis) -> None:
    job = farm.submit(**QUICK)
    with farm.monitor():
        until(lambda: client.hget(keys.job(job.id), "planned") != "0")
        held = farm.lease()  # slice 0 is never committed, so nothing can be merged
        assert held is not None
        # While another job is rendered from its first slice to its end
        work(farm, farm.submit(**QUICK))
    assert int(client.hget(keys.job(job.id), "planned")) <= 3


def ended(farm: NoiseFarm, **spec: object) -> Job:
    with farm.monitor():
        return farm.finish(farm.submit(**{**QUICK, **spec}))


def stops(farm: NoiseFarm, job: Job, rule: str = "reverse") -> list[int]:
    """At which spp the rule would have stopped it."""
    return [point.spp for point in farm.jobs.curve(job.id) if point.rules[rule].stop]


def test_a_job_goes_on_till_min_spp_and_ends_by_its_rule(farm: NoiseFarm) -> None:
    free = ended(farm)
    assert "min_spp" not in free.reason
    least = free.spp + 50  # between two evaluations
    held = ended(farm, min_spp=least)
    # The curve says what the rule said all along
    assert stops(farm, held)[0] == free.spp
    # And the job ended where it said so first beyond
    assert held.state is JobState.CONVERGED
    assert held.spp == min(spp for spp in stops(farm, held) if spp >= least) > free.spp
    assert held.verdict is not None
    assert "levelled off" in held.reason
    if held.spp - 20 < least:
        assert f"min_spp is {least}, so it could not end earlier" in held.reason


def test_a_fixed_number_of_samples_gives_way_to_min_spp(farm: NoiseFarm) -> None:
    job = ended(farm, rule={"name": "fixed", "spp": 40}, min_spp=110)
    assert (job.state, job.spp) == (JobState.CONVERGED, 120)
    assert job.reason.endswith("min_spp is 110, so it could not end earlier")
    # As high as the cap, it lets the rule decide there
    job = ended(farm, rule={"name": "fixed", "spp": 20}, max_spp=80, min_spp=80)
    assert (job.state, job.spp) == (JobState.CONVERGED, 80)


SLICES = 64


class FarStore(Blobs):
    """A store whose answers take time; it counts who waits for them."""

    def __init__(self, where: str) -> None:
        super().__init__(where)
        self.waiting = self.most_waiting = 0
        self._lock = threading.Lock()

    def get(self, name: str) -> bytes:
        with self._lock:
            self.waiting += 1
            self.most_waiting = max(self.most_waiting, self.waiting)
        time.sleep(3 * SLOW_S)
        with self._lock:
            self.waiting -= 1
        return super().get(name)


def submit_committed(farm: NoiseFarm, client: redis.Redis) -> Job:
    """A job of which all slices are committed before a monitor has seen one."""
    spp = 10 * SLICES
    rule = {"name": "fixed", "spp": spp}
    job = farm.submit(slice_spp=10, step=spp // 2, max_spp=spp, rule=rule)
    owners = Ownerships(client, lease_s=60)
    owned = owners.acquire(job.id)
    assert owned is not None
    owners.plan(owned, range(SLICES))
    owners.disown((owned,))
    farm.render(SLICES)
    return job


def test_partials_are_read_ahead_and_merged_in_order(
    client: redis.Redis, redis_url: str, tmp_path: Path
) -> None:
    farm = NoiseFarm(client, redis_url, tmp_path)
    far = FarStore(farm.settings.blobs or "")
    near_job = submit_committed(farm, client)
    with farm.monitor():
        farm.finish(near_job)
    # When the store is far, and one of the partials is lost and rendered again
    far_job = submit_committed(farm, client)
    (lost,) = (name for name in far.names(f"jobs/{far_job.id}/") if "000020" in name)
    far.delete(lost)
    farm.store = far
    with farm.monitor():
        farm.finish(far_job)
    # Then several were read at a time, and the image has the same bits
    assert far.most_waiting > 1
    one, other = (decode_image(farm.picture(job, "image.exr")) for job in (near_job, far_job))
    assert one.tobytes() == other.tobytes()
