"""Where noise is left to see: the picture of what `estimate_pixels` counts."""

import io

import numpy as np
import pytest
from PIL import Image

from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from plateau.metric import Evidence, Half, VisibleDifferences
from tests.support.farms.finished_jobs import finished
from tests.support.farms.noise_farm import NoiseFarm, noise_film
from tests.support.images import PAPER
from tests.support.until import until

#: The marks of pixels that differ visibly in two images with such noise, and in one.
BOTH, ONE = (255, 140, 0), (170, 70, 0)


def left(farm: NoiseFarm, job: Job) -> float:
    """How many pixels the picture marks."""
    with Image.open(io.BytesIO(farm.picture(job, "noise.png"))) as picture:
        pixels = np.asarray(picture.convert("RGB"))
    return float((pixels == BOTH).all(-1).sum() + (pixels == ONE).all(-1).sum() / 2)


def test_it_marks_the_pixels_that_the_last_point_counts(farm: NoiseFarm) -> None:
    job = finished(farm, step=50, rule={"name": "fixed", "spp": 100}, max_spp=100)
    [_, last] = farm.jobs.curve(job.id)
    assert last.estimate_pixels > 10
    assert left(farm, job) == last.estimate_pixels


def test_an_image_between_two_points_has_its_own(farm: NoiseFarm) -> None:
    job = farm.submit(step=50, max_spp=200)
    with farm.monitor():
        farm.render(2)
        until(lambda: farm.jobs.get(job.id).spp == 50)
        farm.render(1)
        farm.jobs.cancel(job.id)
        until(lambda: farm.is_finished(job))
    ended = farm.jobs.get(job.id)
    assert (ended.state, ended.image_spp) == (JobState.CANCELLED, 75)
    films = [noise_film(index, 25, farm.sigma) for index in range(3)]
    first, second, third = (film[..., :3] / film[..., 3:] for film in films)
    evidence = Evidence(
        spp=75,
        image=(first + second + third) / 3,
        halves=(Half((first + third) / 2, 50), Half(second, 25)),
        metric=VisibleDifferences(PAPER),
    )
    assert evidence.estimate is not None
    assert left(farm, ended) == pytest.approx(evidence.estimate.pixels, abs=1)


def test_a_rule_of_the_eye_of_today_has_a_map_of_its_own(farm: NoiseFarm) -> None:
    noisy, clear = (
        finished(
            farm,
            step=50,
            rule={"name": "fixed", "spp": spp},
            watch=[{"name": "jod"}],
            max_spp=spp,
            view={"pixels_per_degree": 40},
        )
        for spp in (100, 400)
    )

    def lost(job: Job) -> float:
        with Image.open(io.BytesIO(farm.picture(job, "quality.png"))) as picture:
            return float(np.asarray(picture).mean())  # as indices of its colours

    assert lost(noisy) > 1.2 * lost(clear) > 0


def test_a_single_slice_has_none(farm: NoiseFarm) -> None:
    job = finished(farm, step=25, rule={"name": "fixed", "spp": 25}, max_spp=25)
    with pytest.raises(FileNotFoundError):
        farm.picture(job, "noise.png")
