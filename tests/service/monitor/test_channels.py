"""The channels of a film, from the partials of slices to the image and its files."""

import io
import json
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
import redis
from PIL import Image

from plateau.farm.blobs import names as blobs
from plateau.farm.images.exr import decode_image, decode_layers
from plateau.farm.model import versions
from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from plateau.metric import encode_srgb
from tests.support.farms.finished_jobs import go_on
from tests.support.farms.noise_farm import SIZE, NoiseFarm, ramp
from tests.support.images.plain_exr import header
from tests.support.until import until

AOVS = ("albedo", "depth", "shape_id")
NAMES = {"R", "G", "B", "A", "albedo.R", "albedo.G", "albedo.B", "Z", "id.shape"}
JOB = {"step": 20, "slice_spp": 10, "max_spp": 80, "rule": {"name": "fixed", "spp": 80}}


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, tmp_path: Path) -> NoiseFarm:
    return NoiseFarm(client, redis_url, tmp_path, sigma=0.1, alpha=True)


def finished(farm: NoiseFarm, **spec: object) -> Job:
    job = farm.submit(**{**JOB, **spec})
    with farm.monitor():
        return farm.finish(job)


def test_one_exr_has_colour_alpha_and_the_aovs_by_name(farm: NoiseFarm) -> None:
    done = finished(farm, aovs=AOVS)
    layers = decode_layers(farm.picture(done, "image.exr"))
    assert layers.keys() == NAMES
    # Colour is the sum of the prefix over its weights, and so are alpha and the AOVs
    made = ramp(0.1, AOVS, alpha=True)
    names = made.channels.names
    films = [made.film(10, seed=index).astype(np.float64) for index in range(8)]
    image = sum(films)
    for name in NAMES - {"id.shape"}:
        expected = (image[..., names.index(name)] / 80).astype(np.float32)
        assert np.array_equal(layers[name], expected), name
    # Ids are whole numbers: each pixel has that of its first sample
    assert np.array_equal(layers["id.shape"], films[0][..., names.index("id.shape")])
    assert set(np.unique(layers["id.shape"])) == set(range(1, 10))
    assert any(not np.array_equal(films[0][..., -1], film[..., -1]) for film in films)
    # Who wants colour alone, or one layer, has it from the same file
    content = farm.picture(done, "image.exr")
    for layer, prefix in ((None, ""), ("albedo", "albedo.")):
        colour = np.stack([layers[f"{prefix}{name}"] for name in "RGB"], axis=-1)
        assert np.array_equal(decode_image(content, layer), colour)


def test_a_half_file_keeps_ids_and_depth_whole(farm: NoiseFarm) -> None:
    exact = decode_layers(farm.picture(finished(farm, aovs=AOVS), "image.exr"))
    half = finished(farm, aovs=AOVS, exr={"precision": "half", "compression": "piz"})
    content = farm.picture(half, "image.exr")
    assert header(content)["compression"] == OpenEXR.PIZ_COMPRESSION
    with OpenEXR.File(io.BytesIO(content), separate_channels=True) as file:
        whole = {name for name, one in file.channels().items() if one.pixels.dtype == np.float32}
    assert whole == {"Z", "id.shape"}
    for name, values in decode_layers(content).items():
        assert np.array_equal(values, exact[name] if name in whole else exact[name].astype("e"))


def test_an_image_says_what_made_it(farm: NoiseFarm) -> None:
    done = finished(farm, name="küche 厨房.xml", aovs=AOVS)
    said = header(farm.picture(done, "image.exr"))
    schedule = done.spec.seed_schedule(done.variant or "", SIZE[1], SIZE[0])
    own = {name.partition(":")[2]: value for name, value in said.items() if "plateau:" in name}
    time = own.pop("time")
    assert time.endswith("+00:00")
    assert json.loads(own.pop("rule")) == {"name": "fixed", "spp": 80}
    assert own == {
        "job": done.id,
        "spp": 80,
        "scene": "küche 厨房.xml",
        "scene_sha256": "00",
        "first_seed": str(schedule.seed_range(0).first),
        "last_seed": str(schedule.seed_range(7).last),
        "variant": "scalar_rgb",
        "renderer": "analytic 1",
        "state": "converged",
        "reason": done.reason,
        "plateau": versions.plateau(),
    }
    assert said["chromaticities"] == pytest.approx(
        (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
    )
    picture = Image.open(io.BytesIO(farm.picture(done, "image.png")))
    assert picture.text == {
        "plateau:job": done.id,
        "plateau:spp": "80",
        "plateau:scene": "küche 厨房.xml",
        "plateau:scene_sha256": "00",
    }


def test_a_background_is_seen_and_judged_and_the_exr_does_not_have_it(farm: NoiseFarm) -> None:
    background = (0.5, 0.25, 1.0)
    black = finished(farm, aovs=AOVS, variance=True)
    coloured = finished(farm, aovs=AOVS, variance=True, view={"background": background})
    # The EXR is the same, premultiplied
    layers, before = (decode_layers(farm.picture(one, "image.exr")) for one in (coloured, black))
    names = (*NAMES, *(f"variance.{name}" for name in "RGB"))
    assert all(np.array_equal(layers[name], before[name]) for name in names)
    # The picture shows it where the image is not opaque
    colour = np.stack([layers[name] for name in "RGB"], axis=-1)
    over = colour + (1 - layers["A"][..., None]) * np.array(background, np.float32)
    shown = np.asarray(Image.open(io.BytesIO(farm.picture(coloured, "image.png"))))
    assert np.array_equal(shown, encode_srgb(over, 0.0))
    assert not np.array_equal(over, colour)
    # And noise is judged before it: on a bright background, less of it is seen
    noise = [farm.jobs.curve(one.id)[0].estimate_pixels for one in (black, coloured)]
    assert noise[0] != noise[1]


@pytest.mark.parametrize("how", ["by its rule", "by a person"])
def test_aovs_that_are_not_finite_are_noted_and_end_nothing(farm: NoiseFarm, how: str) -> None:
    spp = 80 if how == "by its rule" else 4000
    spec = {**JOB, "max_spp": spp, "rule": {"name": "fixed", "spp": spp}}
    job = farm.submit(**spec, aovs=AOVS, view={"background": (1, 1, 1)})
    names = ramp(0.1, AOVS, alpha=True).channels.names
    with farm.monitor():

        def step() -> bool:
            lease = farm.lease()
            if lease is not None:
                film = farm.film(lease)
                film[:12, :, names.index("Z")] = np.nan
                film[0, 0, names.index("A")] = np.inf
                farm.commit(lease, film)
            now = farm.jobs.get(job.id)
            if how == "by a person" and now.points >= 2 and not now.state.ended:
                farm.jobs.cancel(job.id)
            return farm.is_finished(job)

        until(step)
    done = farm.jobs.get(job.id)
    assert done.state is (JobState.CONVERGED if how == "by its rule" else JobState.CANCELLED)
    assert done.non_finite_pixels == 0
    assert done.notes == (
        "image.exr has values that are NaN or infinite: A in 1 pixels, Z in 384 pixels",
    )
    layers = decode_layers(farm.picture(done, "image.exr"))
    assert np.isnan(layers["Z"]).sum() == 384
    assert np.isinf(layers["A"]).sum() == 1


def test_slices_without_the_aovs_are_rendered_again_and_then_fail_the_job(farm: NoiseFarm) -> None:
    # Given a worker that is older than AOVs
    job = farm.submit(**JOB, aovs=AOVS)
    farm.blind = True
    with farm.monitor():
        done = farm.finish(job)
    assert done.state is JobState.FAILED
    assert "slice 0 lacks the channels Z, albedo.B, albedo.G, albedo.R, id.shape" in done.reason
    assert "upgrade it" in done.reason


def test_an_image_of_workers_of_several_kinds_says_so(farm: NoiseFarm) -> None:
    farm.kinds = ("analytic 1 (numpy; one CPU; bits 00)", "analytic 1 (numpy; another; bits 11)")
    done = finished(farm)
    both = ", ".join(farm.kinds)
    assert header(farm.picture(done, "image.exr"))["plateau:renderer"] == both
    assert done.notes == (f"workers of 2 kinds rendered the image: {both}",)


def test_a_job_whose_film_has_alpha_now_fails_in_words(farm: NoiseFarm) -> None:
    farm.alpha = False
    stopped = finished(farm, rule={"name": "fixed", "spp": 40})
    farm.alpha = True
    with farm.monitor():
        done = farm.finish(go_on(farm, stopped, rule={"name": "fixed", "spp": 80}))
    assert done.state is JobState.FAILED
    assert (
        "slice 4 has the channels R, G, B, W, A, those before it R, G, B, W: submit the scene as "
        "a new job"
    ) in done.reason
    # What it had before is still shown
    assert blobs.of_job(stopped.id) in farm.jobs.results(stopped.id)
    assert decode_layers(farm.picture(stopped, "image.exr")).keys() == {"R", "G", "B"}
