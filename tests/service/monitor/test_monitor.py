"""The monitor brings a job to its end, whatever happens to it on the way."""

from itertools import chain, count, repeat
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import redis

from plateau.client.events import is_rendered, typed
from plateau.farm.blobs import names as blobs
from plateau.farm.images.exr import decode_image
from plateau.farm.ledger.queue import Lease
from plateau.farm.model.job import CurvePoint, Job
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.service.monitor import monitor, room
from plateau.service.monitor.job_run import JobRun
from plateau.service.monitor.result_sets import ResultSets
from tests.support.farms.finished_jobs import finish_by_many_monitors
from tests.support.farms.noise_farm import SIZE, NoiseFarm, noise_film
from tests.support.until import until

QUICK = {"step": 20, "slice_spp": 10, "max_spp": 4000, "rule": {"name": "reverse"}}


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
        done = farm.finish(job)
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
    assert f"{done.spp // 10:07d}" in sums
    assert farm.jobs.events(job.id)[-1].type == "finished"


def test_a_job_states_its_error_whether_it_decides_or_is_watched(farm: NoiseFarm) -> None:
    watch = [{"name": "psnr", "target": 120}, {"name": "noise"}]
    rule = {"name": "rmse", "target": 0.1, "min_spp": 1}
    job = farm.submit(**{**QUICK, "rule": rule}, watch=watch)
    finish_by_many_monitors(farm, job)
    done = farm.jobs.get(job.id)
    assert done.state is JobState.CONVERGED
    assert done.verdict is not None
    points = farm.jobs.curve(done.id)
    said = points[-1].rules["rmse"]
    assert said.low is not None and said.high is not None  # noqa: PT018
    assert said.low < done.verdict["value"] < said.high
    assert points[0].rules["rmse"].value is None  # of two slices
    # And that is the error, against the light without noise
    truth = noise_film(0, 10, 0.0)[..., :3].astype(np.float64) / 10
    error = np.square(decode_image(farm.picture(done, "image.exr")) - truth).mean() ** 0.5
    assert said.low < error < said.high
    assert points[-1].rules["psnr"].value is not None
    assert not points[-1].rules["psnr"].stop


def test_a_time_limit_exhausts_a_job_and_keeps_its_samples(farm: NoiseFarm) -> None:
    job = farm.submit(**QUICK, time_limit_s=60)
    # And two that no worker takes, of which one's limit counts from its submission
    patient = farm.submit(**QUICK, time_limit_s=0.5, priority=-1)
    late = farm.submit(**QUICK, time_limit_s=0.5, time_limit_from="submission", priority=-1)
    with farm.monitor():
        farm.render(1)
        until(lambda: farm.jobs.get(job.id).image_spp)
        farm.client.hset(keys.job(job.id), "started_at", 1)
        until(lambda: farm.is_finished(late) and farm.is_finished(job))
    done = farm.jobs.get(job.id)
    assert (done.state, done.spp) == (JobState.EXHAUSTED, 10)
    assert "time limit of 60 s" in done.reason
    assert farm.picture(job, "image.png")
    done = farm.jobs.get(late.id)
    assert (done.state, done.spp) == (JobState.FAILED, 0)
    assert done.reason == "no slice of it was rendered within its time limit of 0.5 s"
    assert farm.jobs.get(patient.id).state is JobState.QUEUED


def test_a_moment_without_memory_costs_no_job(
    farm: NoiseFarm, monkeypatch: pytest.MonkeyPatch
) -> None:
    turn, lacks = JobRun.advance, count()

    def without_memory(run: JobRun, *given: Any) -> bool:
        if next(lacks) in lacking:
            raise MemoryError
        return turn(run, *given)

    monkeypatch.setattr(JobRun, "advance", without_memory)
    lacking = range(3, 6)
    with farm.monitor():
        assert farm.finish(farm.submit(**QUICK)).state is JobState.CONVERGED
        # But not for ever
        lacking = range(10**9)
        monkeypatch.setattr(monitor, "_MOST_LACKS", 2)
        done = farm.finish(farm.submit(**QUICK))
    assert (done.state, "merge cannot continue" in done.reason) == (JobState.FAILED, True)


def test_a_film_for_which_memory_has_no_room_ends_its_job_and_no_monitor(
    farm: NoiseFarm, monkeypatch: pytest.MonkeyPatch
) -> None:
    needed = 300 * 32 * 24
    monkeypatch.setattr(monitor, "_MOST_LACKS", 2)
    with farm.monitor():
        monkeypatch.setattr(room, "memory_left", lambda: needed - 1)
        done = farm.finish(farm.submit(**QUICK))
        assert done.state is JobState.FAILED
        assert "32×24 pixels take 0.0 GB, and this monitor, which may have" in done.reason
        monkeypatch.setattr(room, "memory_left", lambda: needed)
        assert farm.finish(farm.submit(**QUICK)).state is JobState.CONVERGED


FRAME = {"allocation": {"name": "frame"}}


@pytest.mark.parametrize(
    ("spec", "has_sums", "bytes_of_one"),
    [
        ({**FRAME, "rule": "visible"}, False, 300),
        ({**FRAME, "rule": "jod"}, False, 410),
        ({**FRAME, "rule": "jod", "aovs": ["depth"]}, False, 434),
        ({"allocation": {"name": "zones"}, "rule": "jod"}, False, 560),
        ({"allocation": {"name": "zones"}, "rule": "jod"}, True, 280),
    ],
)
def test_a_film_waits_for_the_memory_that_others_have(
    farm: NoiseFarm,
    monkeypatch: pytest.MonkeyPatch,
    spec: dict[str, Any],
    has_sums: bool,
    bytes_of_one: int,
) -> None:
    film = {"width": 10, "height": 10, "committed_spp": 1}
    job = farm.submit(**spec).model_copy(update=film)
    left = 100 * bytes_of_one
    monkeypatch.setattr(room, "memory_left", lambda: left)
    for is_alone in (False, True):
        room.check_room(job, has_sums=has_sums, is_alone=is_alone)
    left -= 1
    for is_alone, lack in ((False, room.NoRoom), (True, MemoryError)):
        with pytest.raises(MemoryError) as found:
            room.check_room(job, has_sums=has_sums, is_alone=is_alone)
        assert found.type is lack


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
        farm.finish(undisturbed)
    disturbed = farm.submit(**QUICK)
    leases = leases_after_a_point(farm, disturbed, 3)
    # Given slices that were committed while no monitor looked, and harmed before one does
    for lease, harm in zip(leases, (spoil, truncate, lose), strict=True):
        farm.commit(lease)
        harm(farm, lease)
    with farm.monitor():
        done = farm.finish(disturbed)
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
        assert farm.finish(farm.submit(**QUICK)).state is JobState.CONVERGED


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
        assert farm.finish(other).state is JobState.CONVERGED
        assert farm.jobs.get(stuck.id).state is JobState.RENDERING
        # When it can be read again, the job goes on
        unreadable.unlink()
        unreadable.write_bytes(content)
        assert farm.finish(stuck).state is JobState.CONVERGED


def test_results_that_cannot_be_written_do_not_hold_the_monitor(
    farm: NoiseFarm, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise ValueError("no picture of this")

    monkeypatch.setattr(ResultSets, "_pictures", refuse)
    with farm.monitor():
        done = farm.finish(farm.submit(**QUICK))
    assert done.state is JobState.FAILED
    assert "no picture of this" in done.reason
    assert farm.store.names(blobs.results(done.id)) == []


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


def ended(farm: NoiseFarm, **spec: object) -> Job:
    with farm.monitor():
        job = farm.finish(farm.submit(**{**QUICK, **spec}))
    events = [typed(event) for event in farm.jobs.events(job.id)]
    kinds = [one.type for one in events if one.type == "point" or is_rendered(one)]
    assert (set(kinds[:-2]), kinds[-2:]) == ({"point"}, ["rendered", "state"])
    return job


def test_a_fixed_number_of_samples_gives_way_to_min_spp(farm: NoiseFarm) -> None:
    job = ended(farm, rule={"name": "fixed", "spp": 40}, min_spp=110)
    assert (job.state, job.spp) == (JobState.CONVERGED, 120)
    assert job.reason.endswith("min_spp is 110, so it could not end earlier")
    # As high as the cap, it lets the rule decide there
    job = ended(farm, rule={"name": "fixed", "spp": 20}, max_spp=80, min_spp=80)
    assert (job.state, job.spp) == (JobState.CONVERGED, 80)
    assert ended(farm, max_spp=60).state is JobState.EXHAUSTED
