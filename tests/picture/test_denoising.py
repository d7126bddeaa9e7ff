"""A job whose image is denoised: the rule judges what is delivered, and nobody waits for it."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path

import numpy as np
import psutil
import pytest
import redis

from plateau.farm.images.exr import decode_layers, decode_partial
from plateau.farm.images.png import decode_png
from plateau.farm.model.job import Job
from plateau.farm.model.slices.looks import next_look
from plateau.farm.model.states import JobState
from plateau.metric import Half, encode_srgb
from plateau.picture.denoised import DenoisingTask
from plateau.picture.denoising import child, oidn, process
from tests.support.farms.every_time import save_every_time
from tests.support.farms.finished_jobs import finish_by_many_monitors, finished, go_on, loses
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.images import PAPER
from tests.support.images.plain_exr import header
from tests.support.images.view_transforms import srgb_transform
from tests.support.long_tests import rare
from tests.support.processes.relatives import children_running
from tests.support.threads import working
from tests.support.until import until

RAW = {
    "step": 40,
    "slice_spp": 10,
    "max_spp": 4000,
    "rule": {"name": "visible", "target": 0.02, "min_spp": 1},
}
JOB = {**RAW, "denoise": {"name": "oidn", "guides": False}}
NEVER = {**JOB, "rule": {"name": "visible", "target": 1e-6}}


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, tmp_path: Path) -> NoiseFarm:
    return NoiseFarm(client, redis_url, tmp_path, sigma=0.2)


def layers(farm: NoiseFarm, job: Job) -> dict[str, np.ndarray]:
    return decode_layers(farm.picture(job, "image.exr"))


def colour(found: dict[str, np.ndarray], layer: str = "") -> np.ndarray:
    return np.stack([found[f"{layer}{name}"] for name in "RGB"], axis=-1)


@contextmanager
def killed(most: int) -> Iterator[list[int]]:
    """Kill the first processes that denoise; yields their ids."""
    victims: list[int] = []
    over = threading.Event()

    def watch() -> None:
        while not over.wait(0.05) and len(victims) < most:
            for one in children_running(child.__name__):
                if one.pid not in victims:
                    with suppress(psutil.Error):
                        one.kill()
                        victims.append(one.pid)

    with working(watch, over.set):
        yield victims


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[DenoisingTask]:
    """What the monitors ask to be denoised."""
    tasks: list[DenoisingTask] = []
    start = process.Denoising.start

    def noted(self: process.Denoising, job_id: str, task: DenoisingTask) -> object:
        tasks.append(task)
        return start(self, job_id, task)

    monkeypatch.setattr(process.Denoising, "start", noted)
    return tasks


def test_what_is_judged_is_what_is_delivered(farm: NoiseFarm, asked: list[DenoisingTask]) -> None:
    done, raw = finished(farm, **JOB), finished(farm, **RAW)
    assert len(asked) == done.points  # each look's image once
    assert (done.state, raw.state) == (JobState.CONVERGED, JobState.CONVERGED)
    assert done.spp < raw.spp
    # The image is the blend of what the file has beside it
    found = layers(farm, done)
    weight = found["denoised.weight"][..., np.newaxis]
    assert 0 <= weight.min() < weight.max() <= 1
    blend = weight * colour(found, "denoised.") + (1 - weight) * colour(found, "raw.")
    np.testing.assert_allclose(colour(found), blend, atol=1e-6)
    said = header(farm.picture(done, "image.exr"))
    assert said["plateau:denoiser"].startswith("Open Image Denoise 2.")
    # And the curve says what denoising gives
    first = farm.jobs.curve(done.id)[0]
    assert first.raw_estimate_pixels > first.estimate_pixels
    untouched = farm.jobs.curve(raw.id)[0]
    assert untouched.raw_estimate_pixels is untouched.estimate_undetermined is None
    # By which the rule stopped
    last = farm.jobs.curve(done.id)[-1]
    assert last.estimate_fraction <= 0.02 < last.raw_estimate_pixels / (done.width * done.height)
    assert last.estimate_undetermined is done.estimate_undetermined is False


def test_a_scene_with_a_look_is_judged_and_shown_through_it(
    farm: NoiseFarm, asked: list[DenoisingTask]
) -> None:
    plain = finished(farm, **{**JOB, "rule": {"name": "fixed", "spp": 40}})
    # Given a scene that hides what is bright: it makes it white
    farm.transform = srgb_transform(gain=16)
    job = finished(farm, **{**JOB, "rule": {"name": "fixed", "spp": 40}})
    # Then the denoiser has the image as rendered, which is delivered
    assert asked[-1].gain == 16
    assert asked[-1].image.tobytes() == asked[0].image.tobytes()
    there = layers(farm, job)
    found, weight = colour(there), there["denoised.weight"][..., np.newaxis]
    blend = weight * colour(there, "denoised.") + (1 - weight) * colour(there, "raw.")
    np.testing.assert_allclose(found, blend, atol=1e-6)
    np.testing.assert_array_equal(colour(there, "raw."), colour(layers(farm, plain), "raw."))
    # And its picture is what the scene's look makes of it
    picture = decode_png(farm.picture(job, "image.png")).colour * 255
    assert np.abs(picture - encode_srgb(farm.transform.seen(found))).max() <= 1
    assert (picture == 255).mean() > 0.5
    # In which hardly anything is left to see
    left, before = (farm.jobs.curve(one.id)[-1].estimate_pixels for one in (job, plain))
    assert left < before / 2


@pytest.mark.parametrize("rule", [NEVER["rule"], *rare({"name": "jod", "target": 9.9})])
def test_each_look_says_when_the_next_one_comes(farm: NoiseFarm, rule: dict[str, object]) -> None:
    done = finished(farm, **{**NEVER, "rule": rule, "max_spp": 480, "min_spp": 440})
    points = farm.jobs.curve(done.id)
    assert all(point.expected_spp >= 440 for point in points)
    assert len(points) > 2
    for one, later in pairwise(points[:-1]):
        assert later.spp == next_look(one.spp, 40, one.expected_spp)


def test_a_job_of_so_many_samples_has_a_look_there(farm: NoiseFarm) -> None:
    done = finished(farm, **{**JOB, "rule": {"name": "fixed", "spp": 440}})
    spp = [point.spp for point in farm.jobs.curve(done.id)]
    assert (done.state, spp) == (JobState.CONVERGED, [40, 120, 200, 320, 440])


def test_its_image_depends_on_no_monitor_and_no_order(
    farm: NoiseFarm, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_every_time(monkeypatch)
    one, other = finished(farm, **JOB), farm.submit(**JOB)
    finish_by_many_monitors(farm, other)
    assert farm.jobs.get(other.id).reason == one.reason
    for name, values in layers(farm, one).items():
        np.testing.assert_array_equal(values, layers(farm, other)[name])


def test_the_first_slices_alone_have_guides(farm: NoiseFarm) -> None:
    spec = {**JOB, "denoise": {"name": "oidn"}, "rule": {"name": "fixed", "spp": 120}}
    spec["aovs"] = ["depth"]
    done = finished(farm, **spec, keep_slices=True)
    films = [
        decode_partial(farm.store.get(record["blob"])).channels.names
        for record in farm.jobs.ledger(done.id).values()
    ]
    assert [len(names) for names in films[:12]] == [11] * 7 + [5] * 5
    assert {"albedo.R", "N.X", "Z"} <= layers(farm, done).keys()
    said = header(farm.picture(done, "image.exr"))
    assert "albedo and normal" in said["plateau:denoiser"]
    # They are those of the first seven slices, and colour has all
    first = finished(farm, **{**spec, "rule": {"name": "fixed", "spp": 40}})
    for name, values in layers(farm, first).items():
        if name.startswith(("albedo", "N.")):
            np.testing.assert_allclose(layers(farm, done)[name], values, atol=0.05)
    # What was rendered with AOVs throughout is denoised later, guided by all
    aovs = ["albedo", "normal"]
    asked = finished(farm, **{**RAW, "rule": spec["rule"]}, aovs=aovs, keep_slices=True)
    with farm.monitor():
        again = farm.finish(go_on(farm, asked, denoise=spec["denoise"], max_spp=asked.spp))
    assert (again.state, again.machine_s) == (JobState.CONVERGED, 0)
    assert "denoised.weight" in layers(farm, again)
    # And slices without AOVs are no slices with them
    assert loses(farm, done, denoise={"name": "none"}, aovs=["albedo", "normal"]) == "aovs"


def test_alpha_stays_and_what_is_behind_it_is_not_in_the_colour(
    client: redis.Redis, redis_url: str, tmp_path: Path
) -> None:
    farm = NoiseFarm(client, redis_url, tmp_path, sigma=0.2, alpha=True)
    spec = {**JOB, "rule": {"name": "fixed", "spp": 40}}
    clear = layers(farm, finished(farm, **spec))
    green = layers(farm, finished(farm, **spec, view={"background": (0.0, 0.8, 0.0)}))
    np.testing.assert_array_equal(clear["A"], green["A"])
    np.testing.assert_array_equal(clear["raw.G"], green["raw.G"])
    uncovered = clear["A"] == 0
    assert uncovered.any()
    assert np.abs(colour(green)[uncovered]).max() < 0.1


@pytest.mark.parametrize("more", [*rare(0), 1])
def test_one_that_is_cancelled_is_denoised_as_far_as_it_came(farm: NoiseFarm, more: int) -> None:
    job = farm.submit(**NEVER)
    with farm.monitor():
        farm.work(lambda: farm.jobs.get(job.id).points >= 1)
        farm.render(more)
        farm.jobs.cancel(job.id)
        until(lambda: farm.is_finished(job))
    done = farm.jobs.get(job.id)
    assert done.image_spp >= farm.jobs.curve(job.id)[-1].spp + 10 * more
    assert layers(farm, done)["denoised.weight"].max() > 0


def test_a_process_that_is_killed_is_asked_again(farm: NoiseFarm) -> None:
    alone = finished(farm, **JOB)
    with killed(2) as victims:
        done = finished(farm, **JOB)
    assert len(victims) == 2
    assert (done.state, done.spp) == (alone.state, alone.spp)
    np.testing.assert_array_equal(colour(layers(farm, done)), colour(layers(farm, alone)))


def test_one_whose_image_cannot_be_denoised_fails_in_words(farm: NoiseFarm) -> None:
    with killed(100):
        done = finished(farm, **JOB)
    assert done.state is JobState.FAILED
    assert "the image cannot be denoised: its process ended with status -9" in done.reason


def test_one_too_large_for_the_machine_fails_in_words(
    farm: NoiseFarm, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(process, "memory_bytes", lambda: 10**6)
    done = finished(farm, **JOB)
    assert done.state is JobState.FAILED
    assert "take 0.1 GB of memory to denoise, and the monitor may have 0.0 GB" in done.reason
    # And what there is of it is delivered as it is
    assert "denoised.weight" not in layers(farm, done)
    # So does one where there is no denoiser
    monkeypatch.setattr(oidn, "is_installed", lambda: False)
    done = finished(farm, **JOB)
    assert done.state is JobState.FAILED
    assert "install plateau[denoise]" in done.reason


@pytest.mark.parametrize("size", [(1, 1), (2, 3)])
def test_an_image_may_be_as_small_as_can_be(size: tuple[int, int]) -> None:
    image = np.full((*size, 3), 0.5, np.float32)
    task = DenoisingTask(image, (Half(image, 1), Half(image, 1)), (image, image), PAPER)
    np.testing.assert_allclose(child.denoised(task).blend.image, image, atol=1e-3)


def test_no_other_job_waits_for_it(farm: NoiseFarm) -> None:
    slow = farm.submit(**NEVER)
    with farm.monitor():
        farm.render(4)
        until(lambda: children_running(child.__name__))
        quick = farm.submit(**{**RAW, "rule": {"name": "fixed", "spp": 40}}, priority=1)
        done = farm.finish(quick)
        farm.jobs.cancel(slow.id)
        farm.finish(slow)
    assert done.state is JobState.CONVERGED


class TestContinuing:
    @pytest.mark.parametrize("keep_slices", [False, True], ids=["its sums", "its slices"])
    def test_one_that_goes_on_is_as_if_it_had_never_stopped(
        self, farm: NoiseFarm, keep_slices: bool
    ) -> None:
        def until_spp(spp: int) -> dict[str, object]:
            return {**JOB, "rule": {"name": "fixed", "spp": spp}}

        stopped = finished(farm, **until_spp(80), keep_slices=keep_slices)
        never_stopped = finished(farm, **until_spp(160))
        with farm.monitor():
            done = farm.finish(go_on(farm, stopped, rule={"name": "fixed", "spp": 160}))
        assert done.state is JobState.CONVERGED
        for name, values in layers(farm, never_stopped).items():
            np.testing.assert_array_equal(layers(farm, done)[name], values)

    def test_neither_sums_nor_guides_that_were_not_rendered_are_made_up(
        self, farm: NoiseFarm
    ) -> None:
        asked = {**RAW, "rule": {"name": "fixed", "spp": 40}}
        sums, slices = (finished(farm, **asked, keep_slices=kept) for kept in (False, True))
        # The rules remember other images than denoised ones
        assert loses(farm, sums, denoise=JOB["denoise"]) == "denoise"
        assert loses(farm, slices, denoise=JOB["denoise"]) is None
        assert loses(farm, slices, denoise={"name": "oidn"}) == "denoise"
