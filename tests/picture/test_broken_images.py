"""Pixels that are NaN or infinite: a few are left out of every count, more are no image."""

import csv
import io
from collections.abc import Callable
from pathlib import Path

import httpx
import numpy as np
import pytest
import redis
from PIL import Image

from plateau.farm.images.exr import Pixels, decode_image
from plateau.farm.images.view_transform import ViewTransform
from plateau.farm.model.job import Job, utc_now
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.wire import job_text
from plateau.farm.wire.views import job_view
from plateau.picture.judge import Judge
from plateau.picture.merge import Merge
from tests.support.farms.live_api import live_api
from tests.support.farms.noise_farm import NoiseFarm, noise_film
from tests.support.long_tests import rare
from tests.support.until import until

#: Of an image of these 768 pixels two may be broken.
QUICK = {"step": 20, "slice_spp": 10, "max_spp": 400}
MAGENTA, BLUE = [255, 0, 255], [0, 200, 255]


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, tmp_path: Path) -> NoiseFarm:
    return NoiseFarm(client, redis_url, tmp_path, sigma=0.1)


def broken(index: int, pixels: int, value: float = np.nan) -> Pixels:
    """A slice with so many broken pixels, from the upper left on: their greens are broken."""
    film = noise_film(index, 10, 0.1)
    film.reshape(-1, 4)[:pixels, 1] = value
    return film


def render(farm: NoiseFarm, job: Job, film: Callable[[int], Pixels]) -> Job:
    """Commit slices with these films until the job is finished; returns it as it is then."""

    def step() -> bool:
        lease = farm.lease()
        if lease is not None:
            farm.commit(lease, film(lease.index))
        return farm.is_finished(job)

    until(step)
    return farm.jobs.get(job.id)


def marked(farm: NoiseFarm, job: Job) -> tuple[int, int]:
    """How many pixels the picture marks as NaN and as infinite."""
    picture = Image.open(io.BytesIO(farm.picture(job, "non-finite.png"))).convert("RGB")
    pixels = np.asarray(picture).reshape(-1, 3).tolist()
    return pixels.count(MAGENTA), pixels.count(BLUE)


@pytest.mark.parametrize(
    ("value", "name", "colours"), [(np.nan, "NaN", (3, 0)), (-np.inf, "infinite", (0, 3))]
)
def test_more_than_the_limit_fail_the_job_at_the_first_step(
    farm: NoiseFarm, value: float, name: str, colours: tuple[int, int]
) -> None:
    # Given an emitter that breaks three pixels in each slice
    job = farm.submit(**QUICK, rule={"name": "fixed", "spp": 20})
    with farm.monitor():
        done = render(farm, job, lambda index: broken(index, 3, value))
    # Then the job is no success, and says how many pixels are what, and what to do
    assert done.state is JobState.FAILED
    assert done.spp == 20
    assert done.reason.startswith(f"3 of 768 pixels (0.391 %) are {name}, at most 2 may be")
    assert "an emitter whose radiance is NaN or infinite" in done.reason
    assert "mend the scene" in done.reason
    # A picture shows where, and no rule counts as one that would have stopped
    assert marked(farm, done) == colours
    assert done.non_finite_pixels == 3
    (point,) = farm.jobs.curve(job.id)
    assert (point.non_finite_pixels, point.rules["fixed"].stop) == (3, False)
    # And nothing is said of noise that is left in the rest
    assert done.estimate_pixels is None


def test_an_image_that_breaks_later_fails_its_job_then(farm: NoiseFarm) -> None:
    # Given a job in which one more pixel breaks in every third slice
    def film(index: int) -> Pixels:
        return broken(index, index // 3)

    def ended(job: Job) -> tuple[str, list[int], bytes]:
        done = render(farm, job, film)
        assert done.state is JobState.FAILED
        points = [point.non_finite_pixels for point in farm.jobs.curve(job.id)]
        return done.reason, points, farm.picture(job, "non-finite.png")

    job = farm.submit(**QUICK, rule={"name": "fixed", "spp": 400})
    with farm.monitor():
        undisturbed = ended(job)
    assert undisturbed[1] == [0, 1, 1, 2, 3]
    # And one of which a second monitor takes over half-way
    job = farm.submit(**QUICK, rule={"name": "fixed", "spp": 400})
    with farm.monitor():
        while farm.jobs.get(job.id).points < 2:
            lease = farm.lease()
            if lease is not None:
                farm.commit(lease, film(lease.index))
    # Then both fail at the same sample for the same reason
    with farm.monitor():
        assert ended(job) == undisturbed


def test_a_time_limit_does_not_make_a_broken_image_a_result(farm: NoiseFarm) -> None:
    # Given a job whose time is over before its first step
    far = {**QUICK, "step": 10_000, "max_spp": 10_000}
    job = farm.submit(**far, rule={"name": "visible"}, time_limit_s=600)
    with farm.monitor():
        farm.commit(farm.next_lease(), broken(0, 700))
        until(lambda: farm.jobs.get(job.id).image_spp)
        farm.client.hset(keys.job(job.id), "started_at", 1)
        done = render(farm, job, lambda index: broken(index, 700))
    assert done.state is JobState.FAILED
    assert "reached its time limit of 600 s" in done.reason
    assert "700 of 768 pixels (91.1 %) are NaN" in done.reason
    assert marked(farm, done) == (700, 0)


@pytest.mark.parametrize(
    "rule",
    [
        {"name": "visible", "target": 0.01, "min_spp": 20},
        *rare({"name": "reverse", "epsilon": 100}, {"name": "successive", "threshold": 100}),
    ],
)
def test_a_few_are_left_out_and_every_figure_says_so(
    farm: NoiseFarm, redis_url: str, rule: dict[str, object]
) -> None:
    # Given a job of which one pixel is NaN and one is infinite from the first slice on
    def film(index: int) -> Pixels:
        film = broken(index, 2)
        film[0, 0, 1] = np.inf
        return film

    job = farm.submit(**{**QUICK, "max_spp": 1000}, rule=rule)
    with farm.monitor():
        done = render(farm, job, film)
    # Then it converges as ever
    assert done.state is JobState.CONVERGED
    assert marked(farm, done) == (1, 1)
    image = decode_image(farm.picture(job, "image.exr"))
    assert np.count_nonzero(~np.isfinite(image).all(axis=-1)) == 2
    # And the job, its verdict, its last point, the summary and the files agree
    curve = farm.jobs.curve(job.id)
    assert {point.non_finite_pixels for point in curve} == {2}
    last = curve[-1]
    assert done.verdict is not None
    assert done.verdict["non_finite_pixels"] == done.non_finite_pixels == 2
    if rule["name"] == "visible":
        assert done.verdict["estimate_pixels"] == done.estimate_pixels == last.estimate_pixels
        assert last.rules["visible"].value == last.estimate_fraction
        assert "2 pixels that are NaN or infinite are left out" in done.reason
    assert curve[0].visible_pixels == 0  # the first image, against itself
    summary = job_text.summary(job_view(done), utc_now())
    assert "2 px (0.26 %) are NaN or infinite, and left out" in summary
    with live_api(redis_url, farm.store) as url, httpx.Client(base_url=url, timeout=60) as http:
        path = f"/v1/jobs/{job.id}"
        assert http.get(path).json()["non_finite_pixels"] == 2
        rows = list(csv.DictReader(http.get(f"{path}/curve.csv").text.splitlines()))
        assert {row["non_finite_pixels"] for row in rows} == {"2"}
        answer = http.get(http.get(path).json()["links"]["non_finite_png"])
        assert answer.content == farm.picture(job, "non-finite.png")


def test_an_image_without_light_is_not_good_however_bright_black_is_shown() -> None:
    merge = Merge(slice_spp=100, transform=ViewTransform(np.full((33, 33, 33, 3), 9000, np.uint16)))
    film = np.zeros((16, 16, 4), np.float32)
    film[..., 3] = 100
    for _ in range(4):
        merge.add(film)
    assert merge.image().min() > 0
    verdict = Judge(JobSpec(slice_spp=100)).judge(merge).verdict
    assert (verdict.stop, "the image is black" in verdict.reason) == (False, True)
