"""Mitsuba's pass kernel: the samples are Mitsuba's, and no bit depends on how they are rendered."""

from collections.abc import Iterator
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.support.long_tests import rare
from tests.support.processes.mitsuba_process import (
    MitsubaProcess,
    add_clock,
    by_mitsuba,
    chunks_of_pass,
    machine_code_of_pass,
    next_chunk_after,
    recordings,
    zones_of_pass,
)
from tests.support.variants import library_for

NOISE = Path(__file__).parents[2] / "reference/scenes/noise"

SCENE = """\
<scene version="3.0.0">
    <default name="filter" value="box"/>
    {integrator}
    <sensor type="{camera}">
        <float name="fov" value="45"/>
        <transform name="to_world">
            <lookat origin="0, 1, 5" target="0, 0.6, 0" up="0, 1, 0"/>
        </transform>
        {in_camera}
        <sampler type="independent"/>
        <film type="hdrfilm">
            <integer name="width" value="32"/>
            <integer name="height" value="24"/>
            <rfilter type="$filter"/>
            {in_film}
        </film>
    </sensor>
    <emitter type="constant"><rgb name="radiance" value="0.4, 0.5, 0.7"/></emitter>
    <shape type="sphere">
        <point name="center" x="0" y="1" z="0"/>
        <float name="radius" value="0.8"/>
        <bsdf type="roughconductor"><string name="material" value="Au"/></bsdf>
    </shape>
    <shape type="rectangle">
        <transform name="to_world"><rotate x="1" angle="-90"/><scale value="4"/></transform>
        <bsdf type="diffuse"><texture name="reflectance" type="checkerboard"/></bsdf>
    </shape>
    <shape type="rectangle">
        <transform name="to_world"><rotate x="1" angle="90"/><translate y="3"/></transform>
        <emitter type="area"><rgb name="radiance" value="6, 5, 4"/></emitter>
    </shape>
    {more}
</scene>
"""
PATH = '<integrator type="path"/>'
FOG = """\
<shape type="cube">
    <transform name="to_world"><scale value="0.7"/><translate x="-1.2" y="0.8" z="1"/></transform>
    <bsdf type="null"/>
    <medium name="interior" type="homogeneous">
        <float name="scale" value="3"/><rgb name="albedo" value="0.9, 0.7, 0.6"/>
    </medium>
</shape>
"""
AIR = """\
<medium type="homogeneous">
    <float name="scale" value="0.2"/><rgb name="albedo" value="0.8, 0.7, 0.6"/>
</medium>
"""
ALPHA = '<string name="pixel_format" value="rgba"/>'
AOVS = '<string name="aovs" value="far:depth,up:sh_normal,which:shape_index"/>'

#: What a camera, a film or an integrator may do, by what is put into SCENE.
CASES = {
    "a path tracer": {},
    "depth": {"integrator": '<integrator type="depth"/>'},
    "media, and a camera in one": {
        "integrator": '<integrator type="volpathmis"/>',
        "in_camera": AIR,
        "more": FOG,
    },
    "a crop window, a thin lens and an open shutter": {
        "camera": "thinlens",
        "in_camera": '<float name="aperture_radius" value="0.2"/>'
        '<float name="focus_distance" value="5"/><float name="shutter_close" value="1"/>',
        "in_film": '<integer name="crop_offset_x" value="5"/>'
        '<integer name="crop_offset_y" value="7"/>'
        '<integer name="crop_width" value="20"/><integer name="crop_height" value="11"/>',
    },
    "AOVs and hidden lights": {
        "integrator": f'<integrator type="aov">{AOVS}<integrator type="path" name="image">'
        '<boolean name="hide_emitters" value="true"/></integrator></integrator>',
        "in_film": ALPHA,
    },
}

#: The chance that a test fails without cause, over all of its values (Šidák's correction). It holds
#: for normal statistics. Ours are Student's t of 94 degrees, whose chance is some ten times that.
SIGNIFICANCE = 1e-4
PASSES = 48


def _scene(folder: Path, **parts: str) -> Path:
    empty = {
        "integrator": PATH,
        "camera": "perspective",
        "in_camera": "",
        "in_film": "",
        "more": "",
    }
    (folder / "scene.xml").write_text(SCENE.format(**{**empty, **parts}), encoding="utf-8")
    return folder


@pytest.fixture(scope="module", params=["llvm_ad_rgb"])
def mitsuba(request: pytest.FixtureRequest) -> Iterator[MitsubaProcess]:
    with MitsubaProcess(request.param, library_for(request.param)) as process:
        yield process


def _means(films: NDArray[np.float64], weight: int, channels: list[int]) -> NDArray[np.float64]:
    return films[..., channels] / films[..., weight, None]


def _assert_alike(ours: NDArray[np.float64], theirs: NDArray[np.float64]) -> None:
    """Welch's test of each pixel's mean, and Brown and Forsythe's of its variance."""
    noisy = ours.std(0) + theirs.std(0) > 1e-6
    assert np.allclose(ours.mean(0)[~noisy], theirs.mean(0)[~noisy], atol=1e-5)
    deviations = [np.abs(films - np.median(films, 0)) for films in (ours, theirs)]
    for what, samples in (("mean", (ours, theirs)), ("variance", deviations)):
        one, other = (films[:, noisy] for films in samples)
        error = np.sqrt((one.var(0, ddof=1) + other.var(0, ddof=1)) / PASSES)
        statistic = (one.mean(0) - other.mean(0)) / error
        p_of_each = 1 - (1 - SIGNIFICANCE) ** (1 / statistic.size)
        assert np.abs(statistic).max() < NormalDist().inv_cdf(1 - p_of_each / 2), what


class TestSamples:
    """Film by film, the kernel's samples are those of Mitsuba's own `render`."""

    @pytest.mark.parametrize("case", CASES)
    def test_each_pixel_has_mitsubas_mean_and_variance(self, mitsuba, tmp_path, case):
        loaded = mitsuba.load(_scene(tmp_path, **CASES[case]))
        ours = np.stack([mitsuba.render_pass(16, seed) for seed in range(PASSES)])
        theirs = mitsuba.call(by_mitsuba, 16, range(1000, 1000 + PASSES))
        has_alpha = "A" in loaded.channels
        _assert_alike(
            _means(ours.astype(np.float64), 3, [0, 1, 2, *([4] if has_alpha else [])]),
            _means(theirs, 3 + has_alpha, [0, 1, 2, *([3] if has_alpha else [])]),
        )

    def test_so_it_is_of_what_changes_while_the_shutter_is_open(self, mitsuba, tmp_path):
        mitsuba.call(add_clock)
        shutter = '<float name="shutter_open" value="1"/><float name="shutter_close" value="3"/>'
        mitsuba.load(_scene(tmp_path, integrator='<integrator type="clock"/>', in_camera=shutter))
        ours = np.stack([mitsuba.render_pass(16, seed) for seed in range(PASSES)])
        theirs = mitsuba.call(by_mitsuba, 16, range(1000, 1000 + PASSES))
        _assert_alike(_means(ours.astype(np.float64), 3, [0]), _means(theirs, 3, [0]))

    @pytest.mark.parametrize("filter_", ["gaussian", "lanczos", *rare("tent", "mitchell")])
    def test_so_it_is_under_each_reconstruction_filter(self, mitsuba, tmp_path, filter_):
        mitsuba.load(_scene(tmp_path), filter=filter_)
        ours = np.stack([mitsuba.render_pass(16, seed) for seed in range(PASSES)])
        theirs = mitsuba.call(by_mitsuba, 16, range(1000, 1000 + PASSES))
        _assert_alike(_means(ours.astype(np.float64), 3, [0, 1, 2]), _means(theirs, 3, [0, 1, 2]))
        assert np.allclose(ours[..., 3].mean(0), theirs[..., 3].mean(0), rtol=0.1)

    @pytest.mark.parametrize("variant", ["llvm_ad_spectral", *rare("llvm_ad_mono")])
    def test_so_it_is_where_light_has_other_channels(self, tmp_path, variant):
        with MitsubaProcess(variant, library_for("llvm_ad_rgb")) as process:
            process.load(_scene(tmp_path))
            ours = np.stack([process.render_pass(16, seed) for seed in range(PASSES)])
            theirs = process.call(by_mitsuba, 16, range(1000, 1000 + PASSES))
        colours = [0, 1, 2] if variant == "llvm_ad_spectral" else [0]
        _assert_alike(_means(ours.astype(np.float64), 3, colours), _means(theirs, 3, colours))

    def test_neighbours_pixels_and_passes_share_no_randomness(self, mitsuba):
        # Pixels of this scene are alike, so that all correlation would be of random numbers
        mitsuba.load(NOISE, width=64, height=64)
        films = np.stack([mitsuba.render_pass(4, seed)[..., 0] for seed in range(64)])
        noise = (films - films.mean()) / films.std()
        pairs = {
            "to the right": noise[:, :, 1:] * noise[:, :, :-1],
            "below": noise[:, 1:] * noise[:, :-1],
            "the next pass": noise[1:] * noise[:-1],
        }
        for where, products in pairs.items():
            # One in 16,000 each, by chance
            assert abs(products.mean()) < 4 / np.sqrt(products.size), where


class TestBits:
    """What else is rendered, and how, changes no bit of a pixel."""

    ZONES = ((0, 0, 16, 16), (16, 8, 16, 16), (3, 17, 5, 7))

    @pytest.mark.parametrize("filter_", ["box", "gaussian"])
    @pytest.mark.parametrize("chunk", [1, 700, 5000])
    def test_the_size_of_chunks(self, mitsuba, tmp_path, filter_, chunk):
        mitsuba.load(_scene(tmp_path), filter=filter_)
        whole = mitsuba.render_pass(25, 7)
        assert np.array_equal(mitsuba.call(zones_of_pass, 25, 7, [], chunk), whole)
        assert mitsuba.call(recordings) == 1  # to trace takes up to 0.2 s

    def test_the_chunks_of_a_pass_are_of_one_size(self, mitsuba, tmp_path):
        mitsuba.load(_scene(tmp_path))  # 24 rows of 32 pixels
        row = 32 * 25
        # Given room for ten rows, I expect no last chunk of four
        assert mitsuba.call(chunks_of_pass, 25, 10 * row) == [8 * row, 8 * row, 8 * row]
        assert mitsuba.call(chunks_of_pass, 25, 100 * row) == [24 * row]
        assert mitsuba.call(chunks_of_pass, 25, 1) == [row] * 24

    def test_a_chunk_is_as_large_as_it_can_be_within_a_second(self, mitsuba, tmp_path):
        mitsuba.load(_scene(tmp_path))
        assert mitsuba.call(next_chunk_after, 2**20, 0.3e-6) == 3 * 2**19  # 0.3 s, and then 0.5 s
        assert mitsuba.call(next_chunk_after, 2**21, 0.3e-6) == 2**21
        assert mitsuba.call(next_chunk_after, 3 * 2**20, 0.3e-6) == 2**21  # after 0.9 s
        assert mitsuba.call(next_chunk_after, 2**16, 1.0) == 2**16

    @pytest.mark.parametrize("filter_", ["box", "gaussian"])
    def test_the_machine_code_is_that_of_any_spp(self, mitsuba, tmp_path, filter_):
        # By zones each round has other spp, and to compile takes as long as 500,000 samples
        mitsuba.load(_scene(tmp_path), filter=filter_)
        code = mitsuba.call(machine_code_of_pass, 5)
        assert code
        assert mitsuba.call(machine_code_of_pass, 7) == code

    def test_a_zone_has_the_films_pixels(self, mitsuba, tmp_path):
        mitsuba.load(_scene(tmp_path))
        whole = mitsuba.render_pass(25, 7)
        for zones in ([self.ZONES[1]], self.ZONES, self.ZONES[::-1]):
            film = mitsuba.call(zones_of_pass, 25, 7, zones, 2**18)
            expected = [whole[y : y + h, x : x + w].reshape(-1, 4) for x, y, w, h in zones]
            assert np.array_equal(film, np.concatenate(expected))

    @pytest.mark.parametrize("filter_", ["tent", "gaussian"])
    def test_zones_with_their_borders_add_up_to_the_film(self, mitsuba, tmp_path, filter_):
        border = {"tent": 1, "gaussian": 2}[filter_]
        mitsuba.load(_scene(tmp_path), filter=filter_)
        whole = mitsuba.render_pass(25, 7)
        zones = [(x, y, 16, 12) for y in (0, 12) for x in (0, 16)]
        film = mitsuba.call(zones_of_pass, 25, 7, zones, 2**18)
        added, at = np.zeros(whole.shape), 0
        for x, y, w, h in zones:
            rows = slice(max(0, y - border), min(24, y + h + border))
            columns = slice(max(0, x - border), min(32, x + w + border))
            there = added[rows, columns]
            there += film[at : at + there[..., 0].size].reshape(there.shape)
            at += there[..., 0].size
        assert at == len(film)
        assert np.allclose(added, whole, rtol=1e-5, atol=1e-5)


class TestChannels:
    """Colour, alpha, and what a scene or a job asks for beside."""

    def test_the_job_asks_for_aovs(self, mitsuba, tmp_path):
        asked = ("albedo", "normal", "depth", "position", "uv", "shape_id", "primitive_id")
        loaded = mitsuba.load(_scene(tmp_path), aovs=asked)
        plain = mitsuba.load(_scene(tmp_path)).channels
        assert plain == ("R", "G", "B", "W")
        assert loaded.channels == (
            *plain,
            *("albedo.R", "albedo.G", "albedo.B", "N.X", "N.Y", "N.Z", "Z", "P.X", "P.Y", "P.Z"),
            *("uv.U", "uv.V", "id.shape", "id.primitive"),
        )
        assert loaded.ids == ("id.shape", "id.primitive")

    def test_aovs_are_weighted_sums_and_ids_are_whole_numbers(self, mitsuba, tmp_path):
        loaded = mitsuba.load(_scene(tmp_path), filter="gaussian", aovs=("depth", "shape_id"))
        film = dict(
            zip(loaded.channels, np.moveaxis(mitsuba.render_pass(64, 1), 2, 0), strict=True)
        )
        centre = (11, 16)  # of the sphere, 4.2 from the camera
        assert film["Z"][centre] / film["W"][centre] == pytest.approx(4.2, abs=0.1)
        assert set(np.unique(film["id.shape"])) <= {0.0, 1.0, 2.0, 3.0}
        assert len(np.unique(film["id.shape"])) >= 3

    def test_a_scene_has_aovs_of_its_own(self, mitsuba, tmp_path):
        loaded = mitsuba.load(_scene(tmp_path, **CASES["AOVs and hidden lights"]), aovs=("depth",))
        assert loaded.channels == (
            *("R", "G", "B", "W", "A", "far.T", "up.X", "up.Y", "up.Z", "which.I", "Z"),
        )
        assert loaded.ids == ("which.I",)
        film = mitsuba.render_pass(4, 1)
        assert np.array_equal(film[..., 5], film[..., 10])

    def test_a_moment_integrator_is_unwrapped(self, mitsuba, tmp_path):
        mitsuba.load(_scene(tmp_path))
        expected = mitsuba.render_pass(4, 1)
        wrapped = f'<integrator type="moment">{PATH}</integrator>'
        loaded = mitsuba.load(_scene(tmp_path, integrator=wrapped))
        (note,) = loaded.notes
        assert note.startswith("the 'moment' integrator was replaced by the integrator inside it: ")
        assert np.array_equal(mitsuba.render_pass(4, 1), expected)
