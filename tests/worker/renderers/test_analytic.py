"""The analytic renderer in a real render child: pure samples, a known mean, a known variance."""

import json

import numpy as np
import pytest

from plateau.farm.bundle.analytic import LIGHTS, NOISES, AnalyticScene
from plateau.farm.images.exr import decode_partial, encode_partial
from plateau.farm.model.aovs import AOV_NAMES
from plateau.farm.model.seeds import Pass, SeedSchedule
from plateau.farm.model.slices.zones import Zone
from plateau.worker.renderers.analytic import picture
from plateau.worker.renderers.analytic.picture import Picture
from plateau.worker.renderers.contract import SceneError
from plateau.worker.supervisor.child_process import RenderChild
from plateau.worker.supervisor.child_start import ChildLimits
from tests.support.images import independence
from tests.support.images.plain_exr import partial_of

VARIANT = "analytic:numpy"
LIMITS = ChildLimits(threads=1, memory_bytes=0, timeout_s=60)
SCHEDULE = SeedSchedule(VARIANT, 32, 24, 25, 10_000, job_seed=3)

#: Two-sided, of each test that compares a mean; the seeds are fixed, so it fails always or never.
_Z = 5.0


@pytest.fixture
def child(tmp_path):
    scenes = tmp_path / "scenes"
    scenes.mkdir()
    child = RenderChild(VARIANT, None, LIMITS, tmp_path / "home", [scenes])
    yield child
    child.kill()


def _load(child, folder, sensor=0, parameters=None, aovs=(), **fields):
    (folder / "scenes" / "scene.json").write_text(json.dumps({"analytic": 1, **fields}))
    return child.load(folder / "scenes", "scene.json", parameters or {}, sensor, aovs)


def _film(made, passes):
    """The film of a slice: its passes in their order, added as a render child adds."""
    total = None
    for spp, seed in passes:
        total = made.channels.add(total, made.film(spp, seed))
    return total.astype(np.float32)


def test_a_child_renders_the_films_that_the_picture_has(child, tmp_path):
    scene = _load(child, tmp_path, width=32, parameters={"height": "24"})
    assert (scene.width, scene.height, scene.notes) == (32, 24, ())
    passes = SCHEDULE.passes(2)
    film, _ = child.render(passes)
    assert film.tobytes() == _film(Picture(AnalyticScene(width=32, height=24)), passes).tobytes()
    again, _ = child.render(passes)
    assert again.tobytes() == film.tobytes()
    other, _ = child.render(SCHEDULE.passes(3))
    assert not np.array_equal(other, film)


def test_a_child_renders_alpha_and_aovs_as_it_says(child, tmp_path):
    scene = _load(child, tmp_path, aovs=AOV_NAMES, alpha=True, width=32, height=24)
    assert scene.channels == (
        *("R", "G", "B", "W", "A", "albedo.R", "albedo.G", "albedo.B", "N.X", "N.Y", "N.Z", "Z"),
        *("P.X", "P.Y", "P.Z", "uv.U", "uv.V", "id.shape", "id.primitive"),
    )
    assert scene.ids == ("id.shape", "id.primitive")
    passes = SCHEDULE.passes(2)
    film, _ = child.render(passes)
    made = Picture(AnalyticScene(width=32, height=24, alpha=True), AOV_NAMES)
    assert film.tobytes() == _film(made, passes).tobytes()
    # A sum of 25 samples, but for the ids, which are those of the first pass
    planes = dict(zip(scene.channels, np.moveaxis(film, -1, 0), strict=True))
    assert set(np.unique(planes["A"])) == {0, 12.5, 25}
    assert np.allclose(
        planes["Z"] / 25, np.broadcast_to(4 - 2 * (np.arange(24)[:, None] + 0.5) / 24, (24, 32))
    )
    assert set(np.unique(planes["id.shape"])) == set(range(1, 10))
    assert np.array_equal(planes["id.shape"], made.film(*passes[0])[..., -2])
    # The next scene has none of it
    assert _load(child, tmp_path).channels == ("R", "G", "B", "W")


def test_an_aov_that_it_does_not_have_is_refused_with_those_that_it_has(child, tmp_path):
    with pytest.raises(SceneError, match=r"has no AOV 'fog'; it has albedo, normal, depth"):
        _load(child, tmp_path, aovs=("fog",))


def test_a_film_of_too_many_values_is_refused_before_it_is_rendered(child, tmp_path):
    with pytest.raises(SceneError, match=r"8192×8192 pixels of 7 channels are 469,762,048 values"):
        _load(child, tmp_path, aovs=("normal",), width=8192, height=8192)


def test_a_child_renders_zones_of_a_film_and_a_partial_stores_them(child, tmp_path):
    _load(child, tmp_path, width=32, height=24)
    passes = SCHEDULE.passes(2)
    whole, _ = child.render(passes)
    zones = (Zone(16, 0, 16, 16), Zone(0, 16, 16, 8))
    film, _ = child.render(passes, zones=zones)
    expected = [whole[y : y + h, x : x + w].reshape(-1, 4) for x, y, w, h in zones]
    assert np.array_equal(film, np.concatenate(expected))
    read = decode_partial(encode_partial(partial_of(film, 2, spp=25, zones=zones)))
    assert read.zones == zones
    assert np.array_equal(read.pixels, film)


def test_a_scene_that_it_cannot_render_is_refused_in_words(child, tmp_path):
    with pytest.raises(SceneError, match="light must be one of grey"):
        _load(child, tmp_path, light="sun")
    with pytest.raises(SceneError, match="sensor 0 alone"):
        _load(child, tmp_path, sensor=1)
    assert _load(child, tmp_path, light="grey").width == 64


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("noise", NOISES)
def test_the_mean_is_the_truth(light, noise):
    scene = AnalyticScene(width=32, height=24, light=light, noise=noise, level=0.5)
    made = Picture(scene)
    slices = np.stack([_film(made, SCHEDULE.passes(index)) for index in range(64)])
    means = slices[..., :3].astype(np.float64) / 25
    error = (means - made.truth).mean()
    # The standard error of the mean over slices, pixels and channels, from the samples themselves:
    # neighbours share a filter's noise, and a pixel's channels share its fireflies.
    of_slices = means.mean(axis=(1, 2, 3))
    assert abs(error) < _Z * of_slices.std(ddof=1) / len(slices) ** 0.5
    assert (slices[..., 3] == 25).all()


@pytest.mark.parametrize("noise", ["gaussian", "heavy-tailed", "filtered"])
@pytest.mark.parametrize("additive", [False, True])
def test_the_variance_of_a_sample_is_the_level(noise, additive):
    scene = AnalyticScene(
        width=32, height=24, light="grey", noise=noise, level=0.5, additive=additive
    )
    made = Picture(scene)
    slices = np.stack([_film(made, SCHEDULE.passes(index)) for index in range(256)])
    of_a_sample = (slices[..., :3] / 25 - made.truth).astype(np.float64).var() * 25
    expected = 0.5**2 if additive else (0.5 * 0.35) ** 2
    # 256 × 32 × 24 × 3 values; excess kurtosis of a heavy-tailed slice is 120/25.
    relative = ((2 + (120 / 25 if noise == "heavy-tailed" else 2)) / 589_824) ** 0.5
    assert abs(of_a_sample / expected - 1) < _Z * relative


def test_fireflies_are_rare_and_bright():
    made = Picture(AnalyticScene(width=64, height=64, light="grey", noise="fireflies", level=0))
    spp = 64 * 4096
    film = _film(made, ((4096, seed) for seed in range(64)))
    hit = film[..., 0] > spp * 0.35 + 0.1  # of 2,000 fireflies one is fainter
    expected = hit.size * (1 - np.exp(-spp * picture.FIREFLY_PROBABILITY))
    assert abs(hit.sum() - expected) < _Z * expected**0.5


def test_slices_are_independent():
    made = Picture(AnalyticScene(width=64, height=64, light="grey"))
    schedule = SeedSchedule(VARIANT, 64, 64, 25, 10_000)
    slices = np.stack([_film(made, schedule.passes(index))[..., 0] for index in range(64)])
    verdict = independence.judge(slices, false_failure_rate=1e-6)
    assert verdict.law_holds, verdict
    assert verdict.pairs_uncorrelated, verdict
    # And the judge would find a renderer that does not apply its seed.
    guilty = np.stack([made.film(25, 1)[..., 0] for _ in range(8)])
    assert not independence.judge(guilty, false_failure_rate=1e-6).law_holds


def test_a_job_of_another_seed_draws_other_samples():
    other = SeedSchedule(VARIANT, 32, 24, 25, 10_000, job_seed=4)
    seeds = {one.seed for index in range(400) for one in SCHEDULE.passes(index)}
    assert seeds.isdisjoint(one.seed for index in range(400) for one in other.passes(index))
    assert SCHEDULE.passes(0)[0] == Pass(25, 3 * 2**20)
