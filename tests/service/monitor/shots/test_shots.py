"""A shot: its frames end once each moment of the video is good, whoever looks, and whenever."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.images.exr import Pixels, decode_image, decode_layers
from plateau.farm.ledger.queue import Lease
from plateau.farm.ledger.shots import ShotRecord, Shots, summary
from plateau.farm.ledger.totals import take_census
from plateau.farm.model.job import Job
from plateau.farm.model.shot import ShotLook
from plateau.farm.model.spec import BatchSpec
from plateau.farm.model.states import JobState
from plateau.farm.process.child import NoAnswer
from plateau.farm.redis.commands.sweeps import Forget
from plateau.farm.redis.scripts import Scripts
from plateau.service.monitor.shots import process, tending
from tests.support.farms.every_time import save_every_time
from tests.support.farms.noise_farm import NoiseFarm, ramp
from tests.support.faults.invariants import check_job
from tests.support.until import until

SHOT = {
    "batch": "walk",
    "shot": {"fps": 24, "target": 9.6},
    "rule": {"name": "fixed", "spp": 40},
    "step": 20,
    "slice_spp": 10,
    "max_spp": 2000,
}
FRAMES, NOISY = 14, 4
#: Of a target that the first image meets.
EASY = {"fps": 24, "target": 2}
#: Of one that takes more samples.
GOOD = {"fps": 24, "target": 9.9}


class ShotFarm(NoiseFarm):
    """A farm whose slices are frames, of which one is noisier than the others."""

    def __init__(self, *arguments: Any, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self.frames: list[str] = []
        self.shots = Shots(self.jobs._redis)

    def submit_shot(self, frames: int = FRAMES, **changed: object) -> list[str]:
        asked = {**SHOT, **changed, "parameters": [{"frame": place} for place in range(frames)]}
        specs = BatchSpec.model_validate(asked).job_specs("walk")
        self.jobs.create(*specs, name="walk", scene_sha256="00")
        self.frames = self.jobs._redis.zrange("plateau:batch:walk", 0, -1)[-frames:]
        return self.frames

    def film(self, lease: Lease) -> Pixels:
        place = self.frames.index(lease.job_id)
        sigma = self.sigma * (4 if place == NOISY else 1)
        return ramp(sigma).film(lease.spp, seed=1000 * place + lease.index)

    def record(self) -> ShotRecord:
        found = self.shots.get(self.frames[0])
        assert found is not None
        return found

    def hold(self, frame: str) -> Lease:
        """A slice of this frame, so that it cannot be done."""
        while (lease := self.next_lease()).job_id != frame:
            self.commit(lease)
        return lease

    def is_over(self) -> bool:
        return all(self.jobs.get(frame).finished_at for frame in self.frames)

    def finish_shot(self) -> list[Job]:
        with self.monitor():
            self.work(self.is_over)
        return [self.jobs.get(frame) for frame in self.frames]


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, tmp_path: Path) -> ShotFarm:
    return ShotFarm(client, redis_url, tmp_path, sigma=0.03)


def seen(look: ShotLook) -> dict[str, object]:
    return look.model_dump(exclude={"at", "seconds"})


def has_gone_on(farm: ShotFarm, looks: int) -> bool:
    """Whether a slice can be leased, or a look was noted."""
    more = take_census(farm.client).slices["waiting"] > 0
    return more or farm.is_over() or farm.record().looks > looks


def finish_by_monitors_that_come_and_go(farm: ShotFarm) -> None:
    """Finish the shot by monitors that change all the time, with slices that come last first."""
    while not farm.is_over():
        with farm.monitor():
            held = [lease for lease in (farm.lease() for _ in range(40)) if lease]
            for lease in reversed(held):
                farm.commit(lease)
            looks = farm.record().looks
            until(partial(has_gone_on, farm, looks))


@pytest.mark.long
def test_the_noisy_frame_gets_samples_until_each_moment_is_good(
    farm: ShotFarm, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = farm.submit_shot()
    done = farm.finish_shot()
    looks = farm.shots.looks(frames[0])
    # Its own rule would have stopped each frame at 40 spp, where all of them waited
    assert looks[0].spp == (40,) * FRAMES
    assert min(looks[0].low_frames) < 9.6 <= min(looks[-1].low_frames)
    assert looks[0].worst_frame in {NOISY - 1, NOISY, NOISY + 1}
    # Frames around it were asked for more, in steps, and those far from it were not
    assert {job.state for job in done} == {JobState.CONVERGED}
    spp = [job.spp for job in done]
    assert spp == list(looks[-1].spp)
    assert spp[NOISY] == max(spp) > 40 == spp[-1]
    assert all(one % 20 == 0 for one in spp)
    assert "the target of 9.6 is reached" in done[0].reason
    shot = summary(farm.record())
    assert shot is not None
    assert (shot.state, shot.frames, shot.looks) == ("good", FRAMES, len(looks))
    # One map is left, the last look's
    maps = farm.store.names(f"{blobs.of_job(frames[0])}shot/")
    assert maps == [blobs.flicker_map(frames[0], len(looks) - 1)]
    for job in done:
        check_job(farm.jobs, farm.store, farm.jobs._redis, job.id)

    # Again, by monitors that come and go, with slices that come last first: nothing else is seen
    save_every_time(monkeypatch)
    again = farm.submit_shot()
    finish_by_monitors_that_come_and_go(farm)
    assert list(map(seen, farm.shots.looks(again[0]))) == list(map(seen, looks))
    for job, frame in zip(done, again, strict=True):
        images = (farm.picture(one, "image.exr") for one in (job, farm.jobs.get(frame)))
        assert len(set(map(pixels, images))) == 1
        check_job(farm.jobs, farm.store, farm.jobs._redis, frame)


@pytest.mark.long
def test_denoised_frames_are_judged_as_they_are_delivered(farm: ShotFarm) -> None:
    # Given a shot, and the same one denoised
    raw = farm.submit_shot(5, shot=GOOD, max_spp=40)
    farm.finish_shot()
    asked: dict[str, object] = {"shot": GOOD, "denoise": {"name": "oidn", "guides": False}}
    frames = farm.submit_shot(5, **asked)
    done = farm.finish_shot()
    # Then it shows less noise at the same spp, and ends once each moment of it is good
    noisy, first, *_, last = *farm.shots.looks(raw[0]), *farm.shots.looks(frames[0])
    assert noisy.spp == first.spp
    assert noisy.jod < first.jod < last.jod
    assert min(last.low_frames) >= 9.9 > min(first.low_frames)
    assert {job.state for job in done} == {JobState.CONVERGED}
    for job in done:
        check_job(farm.jobs, farm.store, farm.jobs._redis, job.id)
        assert "denoised.weight" in decode_layers(farm.picture(job, "image.exr"))


def pixels(image: bytes) -> bytes:
    return np.ascontiguousarray(decode_image(image)).tobytes()


def test_a_monitor_that_holds_a_frame_keeps_nothing_of_it_in_memory(farm: ShotFarm) -> None:
    farm.submit_shot(frames=3)
    waiting = farm.frames[:-1]
    with farm.monitor() as monitor:
        farm.hold(farm.frames[-1])
        farm.work(lambda: all(one.is_waiting for one in farm.record().frames[:-1]))
        until(lambda: not set(waiting) & monitor._runs.keys())
        assert farm.record().looks == 0


def test_the_cap_ends_frames_of_a_shot_that_stays_short_of_its_target(farm: ShotFarm) -> None:
    farm.submit_shot(frames=3, max_spp=60, shot={"fps": 24, "target": 9.99})
    done = farm.finish_shot()
    assert {job.state for job in done} == {JobState.EXHAUSTED}
    assert {job.spp for job in done} == {60}
    assert done[0].reason.startswith("reached the cap of 60 spp; ")
    assert "the target is 9.99, and frame" in done[0].reason
    shot = summary(farm.record())
    assert shot is not None
    assert shot.state == "short"


def test_a_shot_without_a_target_is_judged_and_holds_no_frame_for_more(farm: ShotFarm) -> None:
    farm.submit_shot(frames=3, shot={"fps": 24, "target": None})
    done = farm.finish_shot()
    assert {(job.state, job.spp) for job in done} == {(JobState.CONVERGED, 40)}
    shot = summary(farm.record())
    assert shot is not None
    assert (shot.state, shot.looks) == ("judged", 1)


def test_a_shot_that_misses_a_frame_is_not_judged(farm: ShotFarm) -> None:
    farm.submit_shot(frames=3)
    with farm.monitor():
        farm.queue.fail(farm.hold(farm.frames[2]), "no texture of that name")
        farm.work(farm.is_over)
    done = [farm.jobs.get(frame) for frame in farm.frames]
    others = [job for place, job in enumerate(done) if place != 2]
    assert {(job.state, job.spp) for job in others} == {(JobState.CONVERGED, 40)}
    assert f"the shot was not judged: frame 2, job {farm.frames[2]}, has failed" in others[0].reason


@pytest.mark.long
def test_sums_that_are_lost_while_a_frame_waits_are_made_again(farm: ShotFarm) -> None:
    farm.submit_shot(frames=3, shot=EASY)
    with farm.monitor():
        farm.work(lambda: farm.record().frames[0].is_waiting)
    lost = farm.record().frames[0].checkpoint
    assert lost is not None
    farm.store.delete(lost.blob)
    done = farm.finish_shot()
    assert {job.state for job in done} == {JobState.CONVERGED}
    assert farm.shots.looks(farm.frames[0])[0].spp == (40,) * 3


def test_a_look_that_cannot_be_done_lets_the_frames_end_by_their_own_rules(
    farm: ShotFarm, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise NoAnswer("its process ended with status -9")

    monkeypatch.setattr(process.Looking, "look", fails)
    monkeypatch.setattr(tending, "_AGAIN_S", 0.0)
    farm.submit_shot(frames=2)
    done = farm.finish_shot()
    assert {(job.state, job.spp) for job in done} == {(JobState.CONVERGED, 40)}
    assert "the shot was not judged: its process ended with status -9" in done[0].reason


def test_a_frame_that_is_cancelled_while_it_waits_ends_at_once(farm: ShotFarm) -> None:
    farm.submit_shot(frames=3, shot=EASY)
    with farm.monitor():
        held = farm.hold(farm.frames[-1])
        farm.work(lambda: farm.record().frames[0].is_waiting)
        farm.jobs.cancel(farm.frames[0])
        farm.commit(held)
        farm.work(farm.is_over)
    done = [farm.jobs.get(frame) for frame in farm.frames]
    assert [job.state for job in done] == [JobState.CANCELLED, *[JobState.CONVERGED] * 2]
    # It has an image, so the shot was judged with it
    assert farm.record().over == "good"


def test_frames_of_a_shot_whose_first_is_forgotten_end_by_their_own_rules(farm: ShotFarm) -> None:
    first, second = farm.submit_shot(2)
    with farm.monitor():
        farm.jobs.cancel(first)
        until(lambda: farm.jobs.get(first).finished_at)
        assert Scripts(farm.client).run(Forget(job=first, finished_for_ms=0)) == "forgotten"
        farm.work(lambda: bool(farm.jobs.get(second).finished_at))
    done = farm.jobs.get(second)
    assert (done.state, done.spp) == (JobState.CONVERGED, 40)
