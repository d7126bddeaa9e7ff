"""The renderer with the real Mitsuba: purity, raw films, a scene's files, and every refusal."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from plateau.farm.model.seeds import SeedSchedule
from plateau.farm.model.slices.zones import Zone
from plateau.worker.renderers.contract import SceneError
from tests.support import long_tests
from tests.support.long_tests import rare
from tests.support.processes import mitsuba_process
from tests.support.processes.mitsuba_process import MitsubaProcess
from tests.support.variants import library_for

ROOM = Path(__file__).parents[2] / "reference/scenes/room"
NOISE = Path(__file__).parents[2] / "reference/scenes/noise"
SCENES = Path(__file__).parents[3] / "plateau" / "scenes"

SCENE = """\
<scene version="3.0.0">
    <default name="width" value="24"/>
    <integrator type="path"></integrator>
    <sensor type="perspective">
        <sampler type="independent"></sampler>
        <film type="hdrfilm">
            <integer name="width" value="$width"/>
            <integer name="height" value="16"/>
            <rfilter type="box"/>
        </film>
    </sensor>
    <emitter type="constant"/>
    <shape type="sphere">
        <point name="center" x="0" y="0" z="4"/>
        <bsdf type="diffuse" id="grey"/>
    </shape>
</scene>
"""


def _scene(folder: Path, *changes: tuple[str, str]) -> Path:
    """A folder with SCENE in it, with each of these pieces replaced."""
    text = SCENE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "scene.xml").write_text(text, encoding="utf-8")
    return folder


@pytest.fixture
def box_room(mitsuba: MitsubaProcess) -> MitsubaProcess:
    mitsuba.load(ROOM, filter="box")
    return mitsuba


class TestPurity:
    """A pass is a function of scene, variant, spp and seed, to the last bit."""

    def test_the_same_pass_has_the_same_bits_whatever_was_rendered_between(self, box_room):
        first = box_room.render_pass(4, 7)
        others = [box_room.render_pass(spp, seed) for spp, seed in ((1, 3), (16, 7), (2, 0))]
        assert np.array_equal(box_room.render_pass(4, 7), first)
        assert np.array_equal(box_room.render_pass(1, 3), others[0])

    def test_loading_again_changes_no_bit(self, box_room):
        first = box_room.render_pass(4, 7)
        box_room.load(NOISE)
        box_room.render_pass(2, 1)
        box_room.load(ROOM, filter="box")
        assert np.array_equal(box_room.render_pass(4, 7), first)

    def test_a_scene_whose_triangles_are_summed_is_the_same_after_a_render(self, mitsuba):
        # Those sums depend on how many lanes a thread takes at a time, which a render changes
        def film():
            mitsuba.load(SCENES / "bar", width=32, height=24)
            return mitsuba.render_pass(4, 7)

        first = film()
        mitsuba.load(NOISE)
        mitsuba.render_pass(2, 1)
        assert np.array_equal(film(), first)

    @pytest.mark.parametrize("filter_", ["box", "gaussian"])
    def test_other_aovs_change_no_bit_of_the_colour_and_load_no_scene(
        self, mitsuba, tmp_path, filter_
    ):
        folder = _scene(tmp_path, ('<rfilter type="box"/>', f'<rfilter type="{filter_}"/>'))
        guided = mitsuba.load(folder, aovs=("albedo", "normal"))
        film = mitsuba.render_pass(4, 7)
        (folder / "scene.xml").unlink()  # it cannot be read again
        plain = mitsuba.load(folder)
        assert plain.channels == guided.channels[:4] == ("R", "G", "B", "W")
        assert np.array_equal(mitsuba.render_pass(4, 7), film[..., :4])
        assert mitsuba.load(folder, aovs=("depth",)).channels == (*plain.channels, "Z")
        # The same request means the scene as it is now
        with pytest.raises(SceneError):
            mitsuba.load(folder, aovs=("depth",))

    @pytest.mark.parametrize("lens", ["perspective", "thinlens"])
    def test_a_moved_camera_changes_no_bit_and_loads_no_scene(self, mitsuba, tmp_path, lens):
        place = '<transform name="to_world"><translate x="$x"/></transform>'
        thin = '<float name="aperture_radius" value="1"/><float name="focus_distance" value="4"/>'
        camera = f'"{lens}"><float name="fov" value="$fov"/>{thin if lens == "thinlens" else ""}'
        scene = _scene(
            tmp_path,
            ('"perspective">', camera + place),
            (
                "<integrator",
                '<default name="x" value="0"/><default name="fov" value="40"/><integrator',
            ),
        )

        def film(**parameters: object) -> tuple[int, np.ndarray]:
            loaded = mitsuba.load(scene, **parameters)
            assert loaded.width == int(parameters.get("width", 24))
            return mitsuba.call(mitsuba_process.scene_in_use), mitsuba.render_pass(4, 1)

        alone = film(x=0.5)
        film(x=0.5, width=32)  # another film: the scene is loaded
        first, (kept, moved) = film(), film(x=0.5)
        assert kept == first[0]
        assert np.array_equal(moved, alone[1])
        assert not np.array_equal(moved, first[1])
        # Of a camera that differs in more, the scene is loaded
        other, wide = film(x=0.5, fov=60)
        assert other != kept
        assert not np.array_equal(wide, moved)
        with pytest.raises(SceneError, match="float"):
            film(x="left", fov=60)
        assert np.array_equal(film(x=0.5)[1], moved)

    def test_changed_colours_and_lights_change_no_bit_and_load_no_scene(self, mitsuba, tmp_path):
        rgb = '<{} type="{}"><rgb name="{}" value="${}"/></{}>'
        of_bsdfs = {
            "diffuse": "reflectance",
            "plastic": "diffuse_reflectance",
            "roughplastic": "diffuse_reflectance",
            "conductor": "specular_reflectance",
            "principled": "base_color",
        }
        bsdfs = [rgb.format("bsdf", *one, "colour", "bsdf") for one in of_bsdfs.items()]
        bsdfs += [
            f'<bsdf type="{one}"><float name="{name}" value="$rough"/></bsdf>'
            for one, name in (("roughconductor", "alpha"), ("principled", "roughness"))
        ]
        spheres = "".join(
            f'<shape type="sphere"><point name="center" x="{2 * x - 6}" y="0" z="16"/>{one}</shape>'
            for x, one in enumerate(bsdfs)
        )
        lights = "".join(
            rgb.format("emitter", one, name, "light", "emitter")
            for one, name in (("directional", "irradiance"), ("point", "intensity"))
        )
        defaults = (("colour", "0.2, 0.5, 0.3"), ("rough", "0.2"), ("light", "3"))
        declared = "".join(f'<default name="{one}" value="{value}"/>' for one, value in defaults)
        scene = _scene(
            tmp_path,
            ("<integrator", f"{declared}<integrator"),
            ("</scene>", f"{spheres}{lights}</scene>"),
        )

        def film(**parameters: str) -> tuple[int, np.ndarray]:
            mitsuba.load(scene, **parameters)
            return mitsuba.call(mitsuba_process.scene_in_use), mitsuba.render_pass(4, 1)

        other = {"colour": "0, 0.9, 1", "rough": "0.7", "light": "0, 5, 1"}
        alone = film(**other)
        film(width="32")
        first, (kept, changed) = film(), film(**other)
        assert kept == first[0]
        assert np.array_equal(changed, alone[1])
        assert not np.array_equal(changed, first[1])
        with pytest.raises(SceneError, match="reflectance"):
            film(colour="2, 0, 0")
        assert np.array_equal(film()[1], first[1])

    @pytest.mark.parametrize(
        ("threads", "scene"), [(9, "oculist"), *rare((1, "oculist"), (1, "bar"), (3, "plants"))]
    )
    def test_neither_the_process_nor_its_threads_change_a_bit(self, mitsuba, threads, scene):
        # Nine: more than the room's film has blocks of 32 pixels, so that Mitsuba would halve them
        passes = SeedSchedule(mitsuba.variant, 40, 24, slice_spp=103, max_spp=103).passes(0)
        cases = [(ROOM, {"filter": one}, passes) for one in ("box", "gaussian", "lanczos")]
        # Mitsuba alone merges many meshes, numbers the lights, and builds the hierarchy of
        # triangles in another order in each process
        cases.append((SCENES / scene, {"width": 32, "height": 24}, [(4, 7)]))

        def films(process):
            for folder, parameters, wanted in cases:
                process.load(folder, **parameters)
                yield from (process.render_pass(*one) for one in wanted)

        with MitsubaProcess(mitsuba.variant, library_for(mitsuba.variant), threads) as other:
            for film, expected in zip(films(other), films(mitsuba), strict=True):
                assert np.array_equal(film, expected)

    @pytest.mark.parametrize(
        "sampler", ["independent", "stratified", "multijitter", "orthogonal", "ldsampler"]
    )
    def test_the_scenes_sampler_makes_no_difference(self, box_room, sampler):
        expected = box_room.render_pass(4, 7)
        loaded = box_room.load(ROOM, filter="box", sampler=sampler)
        assert np.array_equal(box_room.render_pass(4, 7), expected)
        replaced = f"the scene's '{sampler}' sampler was replaced by 'independent': "
        assert any(note.startswith(replaced) for note in loaded.notes) is (sampler != "independent")

    @pytest.mark.parametrize("pixels", ["rgb", "luminance", "luminance_alpha", "xyz", "xyza"])
    def test_the_films_pixel_format_changes_no_colour(self, box_room, pixels):
        expected = box_room.render_pass(4, 7)
        loaded = box_room.load(ROOM, filter="box", pixels=pixels)
        assert ("A" in loaded.channels) is (pixels in {"luminance_alpha", "xyza"})
        assert np.array_equal(box_room.render_pass(4, 7)[..., :4], expected[..., :4])

    @pytest.mark.parametrize(
        ("inside", "setting", "note"),
        [
            ("sampler", "integer seed 9", "was ignored: "),
            ("sampler", "integer sample_count 16", "of 16 was ignored: "),
            ("integrator", "float timeout 1e-9", "was ignored: "),
            ("integrator", "integer samples_per_pass 1", "was ignored: "),
            ("film", "boolean sample_border true", "was switched off"),
            ("film", "string pixel_format XYZ", "was changed from 'XYZ' to 'rgb': "),
            ("film", "string file_format pfm", "was changed from 'pfm' to 'openexr': "),
            ("film", "string component_format uint32", "was changed from 'uint32' to 'float32': "),
            ("film", "boolean compensate true", "was ignored: "),
        ],
    )
    def test_what_the_farm_changes_or_ignores_is_said_and_changes_no_bit(
        self, mitsuba, tmp_path, inside, setting, note
    ):
        kind, name, text = setting.split()
        value = f'<{kind} name="{name}" value="{text}"/>'
        mitsuba.load(_scene(tmp_path))
        expected = mitsuba.render_pass(4, 1)
        loaded = mitsuba.load(_scene(tmp_path, (f"</{inside}>", f"{value}</{inside}>")))
        (said,) = loaded.notes
        assert said.startswith(f"the {inside}'s {name} {note}")
        assert np.array_equal(mitsuba.render_pass(4, 1), expected)

    def test_what_the_scene_says_as_the_farm_does_it_is_not_remarked_on(self, mitsuba, tmp_path):
        same = "".join(
            f'<string name="{name}" value="{value}"/>'
            for name, value in (("pixel_format", "RGB"), ("component_format", "float32"))
        )
        loaded = mitsuba.load(_scene(tmp_path, ('<rfilter type="box"/>', same)))
        assert loaded.notes == ()

    def test_blocks_of_another_size_are_set_back_in_scalar_variants(self, mitsuba, tmp_path):
        mitsuba.load(_scene(tmp_path))
        expected = mitsuba.render_pass(4, 1)
        small = '<integer name="block_size" value="4"/></integrator>'
        loaded = mitsuba.load(_scene(tmp_path, ("</integrator>", small)))
        assert np.array_equal(mitsuba.render_pass(4, 1), expected)
        if mitsuba.variant == "scalar_rgb":
            (note,) = loaded.notes
            assert note.startswith("the integrator's block_size was changed from 4 to 32: ")

    def test_a_pass_of_a_scalar_variant_is_a_power_of_two(self, box_room):
        for spp in (0, -1, 3, 20, 25, 48) if box_room.variant == "scalar_rgb" else ():
            with pytest.raises(ValueError, match=f"power of two of spp, not {spp}"):
                box_room.render_pass(spp, 0)


class TestOnePassAfterTheOther:
    """A pass may be rendered while the film of the one before is looked at."""

    PASSES = ((4, 7), (1, 3), (2, 9), (4, 8))

    @pytest.mark.parametrize("begun", [0, 1, 3, 4])
    def test_once_it_is_cancelled_no_pass_begins_and_those_before_are_whole(self, box_room, begun):
        films = box_room.call(mitsuba_process.films_until_cancelled, self.PASSES, begun)
        assert len(films) == begun
        for one, film in zip(self.PASSES, films, strict=False):
            assert np.array_equal(film, box_room.render_pass(*one))

    def test_no_memory_is_kept_from_slice_to_slice(self, mitsuba):
        mitsuba.load(ROOM, filter="box", width=128, height=96)

        def render(slices: int) -> int:
            for _ in range(slices):
                mitsuba.call(mitsuba_process.films_until_cancelled, [(1, 0), (1, 1)], 2)
            return mitsuba.call(mitsuba_process.resident_bytes)

        before = render(10)
        # Were their films kept, it would be 5 MB in the short form
        assert render(2000 if long_tests.WANTED else 13) < before + 3_000_000


class TestRawFilm:
    """What comes back is the film before it is divided by its weights."""

    def test_size_type_and_weights_under_a_box_filter(self, mitsuba):
        loaded = mitsuba.load(ROOM, filter="box", width=37, height=21, pixels="rgb")
        film = mitsuba.render_pass(8, 0)
        assert (loaded.width, loaded.height) == (37, 21)
        assert film.shape == (21, 37, 4)
        assert film.dtype == np.float32
        assert (film[..., 3] == 8).all()

    def test_wide_filters_weigh_inner_pixels_more_than_edges(self, mitsuba):
        mitsuba.load(ROOM, filter="gaussian")
        weights = mitsuba.render_pass(64, 0)[..., 3]
        # No samples beyond the edge reach in
        assert weights[0].mean() < weights[1:-1].mean()
        assert weights.min() > 0

    def test_a_crop_window_is_the_film(self, mitsuba):
        loaded = mitsuba.load(ROOM, sensor=1)
        assert (loaded.width, loaded.height) == (17, 11)
        assert loaded.header["plateau:crop"].startswith("8 4 ")
        cropped = mitsuba.render_pass(256, 0)
        assert cropped.shape == (11, 17, 4)
        # And it shows its part of the whole picture
        mitsuba.load(ROOM, filter="box", pixels="rgb")
        whole = mitsuba.render_pass(256, 0)[4 : 4 + 11, 8 : 8 + 17]
        difference = (cropped - whole)[..., :3].mean() / whole[..., :3].mean()
        assert abs(difference) < 0.05


class TestFiles:
    """A scene's files are found beside it, wherever the process was started."""

    def test_includes_meshes_textures_and_environments_are_in_the_image(self, mitsuba):
        mitsuba.load(ROOM, filter="box")
        film = mitsuba.render_pass(64, 0)
        assert np.isfinite(film).all()
        sky, wall, floor = film[0, 0], film[8:14, 16:24], film[22, 20]
        assert sky[:3].min() > 0
        assert np.ptp(wall[..., :3], axis=(0, 1)).min() > 0  # tiles of several colours
        assert floor[:3].max() > 0

    @pytest.mark.parametrize(
        "file",
        [
            *("meshes/floor.ply", "meshes/wall.serialized", "images/tiles.png", "images/sky.exr"),
            *("parts/materials.xml", "scene.xml"),
        ],
    )
    def test_a_missing_file_is_named_and_the_folder_is_not(self, mitsuba, tmp_path, file):
        shutil.copytree(ROOM, tmp_path / "room")
        (tmp_path / "room" / file).unlink()
        with pytest.raises(SceneError) as caught:
            mitsuba.load(tmp_path / "room")
        assert Path(file).name in str(caught.value)
        assert str(tmp_path) not in str(caught.value)

    def test_a_broken_mesh_is_named(self, mitsuba, tmp_path):
        shutil.copytree(ROOM, tmp_path / "room")
        (tmp_path / "room/meshes/floor.ply").write_text("ply\nnonsense\n", encoding="ascii")
        with pytest.raises(SceneError, match=r"floor\.ply"):
            mitsuba.load(tmp_path, "room/scene.xml")  # whose other files are found beside it

    def test_the_files_of_the_scene_before_are_out_of_reach(self, mitsuba, tmp_path):
        mitsuba.load(ROOM)
        shutil.copy(ROOM / "scene.xml", tmp_path)
        with pytest.raises(SceneError, match=r"materials\.xml"):
            mitsuba.load(tmp_path)

    def test_scenes_of_older_versions_are_brought_up_to_date(self, mitsuba, tmp_path):
        old = _scene(
            tmp_path,
            ('version="3.0.0"', 'version="0.6.0"'),
            ('<rfilter type="box"/>', '<string name="pixelFormat" value="rgba"/>'),
            ('</integrator>', '<integer name="maxDepth" value="3"/></integrator>'),
        )  # fmt: skip
        assert mitsuba.load(old).width == 24
        assert mitsuba.render_pass(1, 0).shape == (16, 24, 5)


INTEGRATOR = '<integrator type="path"></integrator>'

REFUSALS = {
    "a parameter that the scene does not have": ([], {"depth": "3"}, r"unused.*\$depth=3"),
    "a parameter that Mitsuba keeps": ([], {"config": "3"}, "cannot be named 'config'"),
    "a parameter of the wrong kind": ([], {"width": "wide"}, 'could not parse integer.*"wide"'),
    "a parameter out of range": ([], {"width": "-3"}, "value -3 is out of bounds"),
    "a film too large": ([], {"width": str(2**23)}, "renders 67,108,864 at most"),
    "a part of a scene": ([(SCENE, '<bsdf version="3.0.0" type="diffuse"/>')], {}, "scene"),
    "no integrator": ([(INTEGRATOR, "")], {}, "the scene has no integrator"),
    "a film that is no hdrfilm": ([('"hdrfilm"', '"specfilm"')], {}, "is a 'specfilm'"),
    "particle tracing": ([('"path"', '"ptracer"')], {}, "'ptracer' does not sample pixel by pixel"),
    "Stokes vectors": (
        [(INTEGRATOR, f'<integrator type="stokes">{INTEGRATOR}</integrator>')],
        {}, "'stokes' renders whole films alone|polarized"
    ),
    "differentiable rendering": (
        [('"path"', '"prb"')], {}, "'PRBIntegrator' is made for diff|Plugin \"prb\" not found"
    ),
    "differentiable rendering, projective": (
        [('"path"', '"direct_projective"')],
        {},
        "'DirectProjectiveIntegrator' is made for diff|Plugin \"direct_projective\" not found",
    ),
}  # fmt: skip


class TestRefusals:
    """What cannot be rendered is a SceneError in Mitsuba's words, without this machine's paths."""

    @pytest.mark.parametrize("case", REFUSALS)
    def test_refused(self, mitsuba, tmp_path, case):
        changes, parameters, says = REFUSALS[case]
        with pytest.raises(SceneError, match=f"(?s){says}") as caught:
            mitsuba.load(_scene(tmp_path, *changes), **parameters)
        assert str(tmp_path) not in str(caught.value)

    def test_nothing_is_loaded_after_a_refusal(self, mitsuba, tmp_path):
        mitsuba.load(ROOM)
        with pytest.raises(SceneError):
            mitsuba.load(tmp_path)
        with pytest.raises(RuntimeError, match="no scene is loaded"):
            mitsuba.render_pass(1, 0)

    def test_a_frame_that_nothing_lights_but_no_zone_and_no_aov_of_it(self, mitsuba, tmp_path):
        dark = _scene(tmp_path, ('<emitter type="constant"/>', ""))
        mitsuba.load(dark)
        left, right = Zone(0, 0, 16, 16), Zone(16, 0, 8, 16)
        for whole in ((), (left, right)):
            with pytest.raises(SceneError, match="is black: the scene has no emitter; add one"):
                mitsuba.call(mitsuba_process.why_black, *whole)
        assert "the scene has no emitter" in mitsuba.call(mitsuba_process.why_black, left)
        mitsuba.load(dark, aovs=("albedo",))
        assert "the scene has no emitter" in mitsuba.call(mitsuba_process.why_black)


def test_a_scene_is_freed_when_the_next_is_loaded(mitsuba):
    def load_and_render() -> int:
        mitsuba.load(NOISE, width=512, height=512)
        mitsuba.render_pass(1, 0)
        return mitsuba.call(mitsuba_process.resident_bytes)

    settled = [load_and_render() for _ in range(2)][-1]
    # Five films of 512×512 would take 20 MiB, and what a pass needs far more.
    assert max(load_and_render() for _ in range(5)) < settled + 16 * 2**20
