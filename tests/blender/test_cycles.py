"""Cycles in a real render child: pure passes, one sequence for each half, and what is refused."""

import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import psutil
import pytest

from plateau.farm.images.channels import Channels
from plateau.farm.model.seeds import SEQUENCE_SAMPLES, Pass, SeedSchedule
from plateau.worker.renderers.contract import Loaded, SceneError
from plateau.worker.supervisor.child_process import Film, RenderChild
from plateau.worker.supervisor.child_start import ChildLimits
from tests.blender.conftest import VARIANT, in_blender


class Child:
    """A confined render child that can open what lies in its folder of scenes."""

    def __init__(self, folder: Path, threads: int = 2) -> None:
        self.scenes = folder / "scenes"
        self.scenes.mkdir(parents=True, exist_ok=True)
        limits = ChildLimits(threads=threads, memory_bytes=0, timeout_s=120)
        self.process = RenderChild(VARIANT, None, limits, folder / "home", [self.scenes])

    def load(self, blend: Path, *, aovs: tuple[str, ...] = (), **parameters: object) -> Loaded:
        shutil.copytree(blend.parent, self.scenes, dirs_exist_ok=True)
        strings = {name: str(value) for name, value in parameters.items()}
        return self.process.load(self.scenes, blend.name, strings, 0, aovs)

    def film(self, *passes: tuple[int, int]) -> Film:
        return self.process.render(tuple(Pass(*one) for one in passes))[0]


@contextmanager
def _child(folder: Path, threads: int = 2) -> Iterator[Child]:
    child = Child(folder, threads)
    try:
        yield child
    finally:
        child.process.kill()


@pytest.fixture(scope="module")
def child(tmp_path_factory) -> Iterator[Child]:
    with _child(tmp_path_factory.mktemp("child")) as one:
        yield one


def _mean(film: Film) -> np.ndarray:
    return film[..., :3].astype(np.float64) / film[..., 3:4]


def test_the_slices_of_a_half_are_stretches_of_one_sequence(child, blend):
    scene = child.load(blend("plain"))
    assert (scene.width, scene.height, scene.channels) == (64, 48, ("R", "G", "B", "W"))
    assert any("Plateau decides" in note for note in scene.notes)
    # Given the passes of a job's first two even slices, as its ledger numbers them
    schedule = SeedSchedule(VARIANT, 64, 48, 16, 10_000, job_seed=3)
    assert [schedule.seed_range(k).first % SEQUENCE_SAMPLES for k in (0, 2)] == [0, 16]
    even = [_mean(child.film(*schedule.passes(k))) for k in (0, 2)]
    # When the sequence's first 32 samples are rendered at once
    whole = child.film((32, schedule.seed_range(0).first))
    # Then they are the same samples
    assert (whole[..., 3] == 32).all()
    assert np.abs((even[0] + even[1]) / 2 - _mean(whole)).max() < 1e-6 * max(1, whole.max() / 32)
    # And the other half has others
    odd = _mean(child.film(*schedule.passes(1)))
    assert np.abs(odd - even[0]).mean() > 1e-3
    again = _mean(child.film(*schedule.passes(0)))
    assert np.array_equal(again, even[0])


def test_smoke_has_the_same_bits_again_and_its_slices_add_up(child, blend):
    scene = child.load(blend("smoke"))
    assert "Volumes: sampled by steps (Biased)." in " ".join(scene.notes)
    # Given a volume, whose unbiased samples differ from one render to the next
    whole = child.film((32, 0))
    again = child.film((32, 0))
    assert again.tobytes() == whole.tobytes()
    parts = child.film((16, 0)).astype(np.float64) + child.film((16, 16))
    assert np.abs(parts - whole).max() < 1e-6 * whole.max()
    # And a scene without one has no such note
    assert "Volumes" not in " ".join(child.load(blend("plain")).notes)


def test_a_shadow_catcher_is_said_to_be_a_little_off(child, blend):
    assert any("shadow catcher" in note for note in child.load(blend("shadow_catcher")).notes)


@pytest.mark.parametrize("name", ["plain", "smoke"])
def test_bits_depend_neither_on_threads_nor_on_bands(blend, tmp_path, name):
    # A pass of so many samples has several bands, whose sizes follow the speed
    films = []
    for threads in (1, 3):
        with _child(tmp_path / str(threads), threads) as child:
            child.load(blend(name), width=211, height=157)
            films.append(child.film((24, 5)))
    assert films[0].tobytes() == films[1].tobytes()


def test_any_band_is_what_it_is_in_the_whole_film(blend):
    # 40 bands of each of nine heights, drawn at random with a fixed seed
    done = subprocess.run(
        in_blender("bands", str(blend("plain"))), capture_output=True, text=True, check=False
    )
    said = [line for line in done.stdout.splitlines() if line.endswith(("differ", "done"))]
    assert said == ["done"], done.stdout + done.stderr[-2000:]


def test_a_child_that_waits_uses_no_processor(blend, tmp_path):
    with _child(tmp_path, threads=1) as child:
        child.load(blend("plain"))
        child.film((4, 0))
        process = psutil.Process(child.process.pid)
        before = sum(process.cpu_times()[:2])
        time.sleep(1)
        assert sum(process.cpu_times()[:2]) - before < 0.25


def test_a_film_has_alpha_and_a_denoisers_guides(child, blend):
    scene = child.load(blend("transparent"), aovs=("albedo", "normal"), camera="above")
    assert scene.channels == (
        *("R", "G", "B", "W", "A", "albedo.R", "albedo.G", "albedo.B", "N.X", "N.Y", "N.Z"),
    )
    film = child.film((16, 0)) / 16
    # In the corner is the floor, which looks upwards
    np.testing.assert_allclose(film[0, 0, 4], 1, atol=1e-6)
    np.testing.assert_allclose(film[0, 0, 8:], (0, 0, 1), atol=1e-4)
    np.testing.assert_allclose(film[0, 0, 5:8], 0.6, atol=0.05)
    # And seen from aside, it still does; beyond it is nothing
    child.load(blend("transparent"), aovs=("albedo", "normal"), camera="aside")
    film = child.film((16, 0)) / 16
    np.testing.assert_allclose(film[-1, 0, 8:], (0, 0, 1), atol=1e-4)
    assert film[0, 0, 4] == 0


def test_the_passes_of_the_view_layer_add_up_and_make_the_image(child, blend):
    scene = child.load(blend("passes"))
    channels = Channels(scene.channels, scene.ids, scene.quotients)
    assert {name.rpartition(".")[0].removeprefix("K_che.") for name in channels.aovs} == {
        *("Depth", "Position", "Object Index", "Material Index", "Normal", "UV", "Mist", "Vector"),
        *(f"{of} Color" for of in ("Diffuse", "Glossy", "Transmission")),
        *(f"{of} Direct" for of in ("Diffuse", "Glossy", "Transmission", "Volume")),
        *(f"{of} Indirect" for of in ("Diffuse", "Glossy", "Transmission", "Volume")),
        *("Emission", "Environment", "Ambient Occlusion", "mine", "Combined_key"),
        *("Denoising Albedo", "Denoising Normal", "Denoising Depth"),
        *(f"Crypto{of}{rank:02}" for of in ("Object", "Material", "Asset") for rank in range(3)),
    }
    left_out = "".join(note for note in scene.notes if "Passes left out" in note)
    assert all(name in left_out for name in ("Shadow Catcher", "Render Time"))
    # Two stretches are the whole, in every channel, and ids are those of the first sample
    whole, first, second = (child.film(one) for one in ((32, 0), (16, 0), (16, 16)))
    total = channels.add(channels.add(None, first), second)
    for plane, name in enumerate(channels.names):
        if name in set(channels.exact) - set(channels.ids):
            continue  # of a Cryptomatte
        of_whole = whole[..., plane]
        assert np.isfinite(of_whole).all(), name
        # Blender 5.2 gives the greatest float as a sum of depths where there is nothing
        there = np.abs(of_whole) < 1e37
        # A mean that is weighted by more than the samples is off where these weights vary
        slack = 0.02 if ".Vector." in name else 1e-6
        most = slack * max(1, np.abs(of_whole[there]).max())
        assert np.abs(total[..., plane] - of_whole)[there].max() <= most, name
    assert set(np.unique(total[..., channels.names.index("K_che.Object Index.X")])) <= {0, 3, 4, 5}
    # And what compositors make of them is the image
    image = channels.normalised(total)

    def of(name: str) -> np.ndarray:
        return np.stack([image[f"K_che.{name}.{letter}"] for letter in "RGB"], axis=-1)

    made = of("Emission") + of("Environment") + of("Volume Direct") + of("Volume Indirect")
    for kind in ("Diffuse", "Glossy", "Transmission"):
        made = made + of(f"{kind} Color") * (of(f"{kind} Direct") + of(f"{kind} Indirect"))
    colour = np.stack([image[letter] for letter in "RGB"], axis=-1)
    assert np.abs(made - colour).max() < 2e-5
    assert of("Diffuse Direct").max() > 0.1
    # And its light group is what the one lamp lights
    lamp = of("Combined_key")
    assert (lamp <= colour + 1e-5).all()
    assert lamp.mean() > 0.3 * colour.mean()


def test_the_cryptomatte_of_slices_is_that_of_the_whole(child, blend):
    scene = child.load(blend("passes"))
    channels = Channels(scene.channels, scene.ids, scene.quotients)
    whole, first, second = (child.film(one) for one in ((32, 0), (16, 0), (16, 16)))
    at_once, of_slices = (
        _shares(channels.normalised(total))
        for total in (channels.add(None, whole), channels.add(channels.add(None, first), second))
    )
    assert at_once.keys() == of_slices.keys()
    for one, share in at_once.items():
        np.testing.assert_allclose(of_slices[one], share, atol=1e-6)
    # And the header names the objects
    names = scene.header
    (key,) = (name for name, value in names.items() if value == "K_che.CryptoObject")
    ids = json.loads(names[key.replace("/name", "/manifest")])
    for name in ("shining", "glass", "glowing"):
        assert at_once[ids[name]].max() == pytest.approx(1)
        edge = (at_once[ids[name]] > 0) & (at_once[ids[name]] < 1)
        assert edge.any()


def _shares(image: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The share of each object in each pixel, by the hexadecimal digits of its id."""
    found: dict[str, np.ndarray] = {}
    for rank in range(3):
        for ids, of in ("rg", "ba"):
            layer = f"K_che.CryptoObject{rank:02}"
            names = image[f"{layer}.{ids}"].view(np.uint32)
            share = image[f"{layer}.{of}"]
            for one in np.unique(names[share > 0]):
                none = np.zeros(share.shape)
                found[f"{one:08x}"] = found.get(f"{one:08x}", none) + share * (names == one)
    return found


def test_light_comes_with_the_colour_by_which_it_is_divided(child, blend):
    scene = child.load(blend("light_alone"))
    assert {name.rpartition(".")[0] for name in scene.channels[4:]} == {
        *("ViewLayer.Diffuse Direct", "ViewLayer.Diffuse Color")
    }


def test_a_film_has_the_aovs_of_the_spec(child, blend):
    aovs = ("depth", "position", "uv", "shape_id")
    scene = child.load(blend("plain"), aovs=aovs, camera="above", width=48, height=48)
    assert scene.channels[4:] == ("Z", "P.X", "P.Y", "P.Z", "uv.U", "uv.V", "id.shape")
    assert scene.ids == ("Z", "P.X", "P.Y", "P.Z", "id.shape")
    film = child.film((16, 0))
    x, y, z = film[..., 5:8].transpose(2, 0, 1)
    # The camera is 6 above the floor, whose corner is far from it
    np.testing.assert_allclose(film[0, 0, 4], np.sqrt(x[0, 0] ** 2 + y[0, 0] ** 2 + 36), 1e-5)
    assert z.max() > 1.5
    assert abs(z[0, 0]) < 1e-4
    assert x[0, 0] < 0 < y[0, 0]
    assert ((film[..., 8:10] / 16 >= 0) & (film[..., 8:10] / 16 <= 1)).all()
    # Of the objects' names Plane comes before Sphere, and lamps and cameras have no number
    assert set(np.unique(film[..., 10])) == {1, 2}
    assert any("shape_id" in note for note in scene.notes)
    # The artist's numbers stay, and one that Cycles does not have is refused
    child.load(blend("passes"), aovs=("shape_id",))
    assert set(np.unique(child.film((4, 0))[..., 4])) <= {0, 3, 4, 5}
    with pytest.raises(SceneError, match="no AOV 'primitive_id'; it has albedo, normal, depth"):
        child.load(blend("plain"), aovs=("primitive_id",))


def test_parameters_choose_size_frame_and_camera(child, blend):
    scene = child.load(blend("plain"), width=40, height=30, camera="above")
    assert (scene.width, scene.height) == (40, 30)
    first = child.film((8, 0))
    child.load(blend("plain"), width=40, height=30, camera="above", frame=5)
    moved = child.film((8, 0))

    def red_column(film: Film) -> float:
        red = np.clip(film[..., 0] - 2 * film[..., 1], 0, None)
        return float((red.sum(axis=0) * np.arange(40)).sum() / red.sum())

    assert red_column(moved) > red_column(first) + 5
    with pytest.raises(SceneError, match=r"no camera 'below'; it has above, aside"):
        child.load(blend("plain"), camera="below")


def test_scripts_and_python_drivers_of_a_file_do_not_run(child, blend):
    child.load(blend("flat"))
    flat = child.film((4, 0))
    scene = child.load(blend("scripted"))
    assert scene.width == 64
    assert np.array_equal(child.film((4, 0)), flat)


def test_a_missing_texture_is_named_before_anything_is_rendered(blend, tmp_path):
    with _child(tmp_path) as child:
        alone = tmp_path / "alone" / "shot.blend"
        alone.parent.mkdir()
        shutil.copy(blend("textured"), alone)
        with pytest.raises(SceneError, match=r"sent with: textures/tiles\.png; pack them"):
            child.load(alone)
        child.load(blend("textured"), camera="above")
        red, green, blue = _mean(child.film((16, 0)))[0, 0]
        assert green > 3 * red
        assert green > 3 * blue


@pytest.mark.parametrize(
    ("name", "says"), [("eevee", "BLENDER_EEVEE; set it to Cycles"), ("cut", "Blender: ")]
)
def test_what_cycles_cannot_render_is_refused_in_words(child, blend, tmp_path, name, says):
    path = tmp_path / "shot.blend"
    if name == "cut":
        path.write_bytes(blend("plain").read_bytes()[:9000])
    else:
        shutil.copy(blend(name), path)
    with pytest.raises(SceneError, match=says):
        child.load(path)
