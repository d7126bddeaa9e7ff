"""OCULIST: well exposed, and covered with fine texture and real relief."""

import math
from pathlib import Path

import numpy as np
import pytest

from plateau.scenes.mesh import Mesh
from plateau.scenes.oculist import build, instruments
from plateau.scenes.oculist.case import meshes
from plateau.scenes.oculist.lettering import cut
from plateau.scenes.oculist.stamps import stamp
from tests.scenes.support import facts, pixels

OCULIST = Path(build.__file__).parent
TEXTURED = ("cloth", "mosaic", "left_tablet", "right_tablet", "frieze")


@pytest.mark.parametrize("intensity", [build.BRIGHT, build.DIM])
def test_it_is_well_exposed_at_ev_0(intensity: float):
    loaded = facts(OCULIST / "scene.xml", intensity)
    assert loaded.median == pytest.approx(0.28 * intensity / build.BRIGHT, rel=0.15)
    assert loaded.clipped < 0.05
    lights = 3 * 2
    assert loaded.faces == lights + sum(len(mesh.faces) for mesh in meshes().values()) < 100_000


def test_textured_relief_covers_most_of_the_image():
    origin, target = np.array(build.ORIGIN), np.array(build.TARGET)
    ahead = (target - origin) / math.dist(target, origin)
    right = np.array([1.0, 0.0, 0.0])
    half = math.tan(math.radians(build.FIELD_OF_VIEW_DEG / 2))
    x, y = np.meshgrid(*2 * [half * (np.arange(64) - 31.5) / 32])
    rays = ahead + x[..., np.newaxis] * right + y[..., np.newaxis] * np.cross(right, ahead)

    covered = np.zeros((64, 64), bool)
    for name in TEXTURED:
        corner, beside, _, above = np.array(meshes()[f"{name}.ply"].vertices[:4])
        edges = np.stack([beside - corner, above - corner], axis=1)
        normal = np.cross(edges[:, 0], edges[:, 1])
        distance = ((corner - origin) @ normal) / (rays @ normal)
        hit = origin + distance[..., np.newaxis] * rays - corner
        along = hit @ edges / (edges * edges).sum(axis=0)
        covered |= ((along > 0) & (along < 1)).all(axis=-1)

    assert covered.mean() > 0.75


@pytest.mark.parametrize("name", TEXTURED)
def test_its_contrast_is_high_and_finer_than_8_pixels_of_256(name: str):
    # At 256 pixels the image is about 2.3 wide where the textures are.
    width = {"cloth": 0.42, "mosaic": 0.98, "frieze": 2.24}.get(name, 0.58) * 256 / 2.3
    levels = pixels((OCULIST / "textures" / f"{name}.png").read_bytes()).mean(axis=-1)
    rows, columns = levels.shape

    power = np.abs(np.fft.fft2(levels - levels.mean())) ** 2
    across, down = np.fft.fftfreq(columns), np.fft.fftfreq(rows)[:, np.newaxis]
    cycles_per_pixel = np.hypot(across, down) * columns / width
    resolved = (cycles_per_pixel > 1 / 8) & (cycles_per_pixel < 1 / 2)

    assert levels.std() / levels.mean() > 0.25
    assert power[cycles_per_pixel > 1 / 8].sum() > 0.7 * power.sum()
    assert power[resolved].sum() > 0.4 * power.sum()


def test_a_stamps_letters_are_cut_into_the_stone_or_stand_out_of_it():
    size, letters = (0.6, 0.2, 0.5), ["LVCIDVM", "OCVLOS"]
    stone = size[0] * size[1] * size[2]
    blank = volume(stamp(size, [" "], [" "], 100, 0.03, seed=1))
    assert blank == pytest.approx(stone, rel=0.03)
    assert volume(stamp(size, letters, [" "], 100, 0.03, seed=1)) < blank - 0.01 * stone
    assert volume(stamp(size, letters, [" "], 100, -0.03, seed=1)) > blank + 0.01 * stone


@pytest.mark.parametrize("name", ["probe", "spoon", "scalpel", "tweezers"])
def test_instruments_are_as_long_as_asked_and_look_outwards(name: str):
    instrument = getattr(instruments, name)(0.8, 0.02)
    x = [vertex[0] for vertex in instrument.vertices]
    assert (min(x), max(x)) == pytest.approx((0.0, 0.8), abs=0.01)
    assert 0 < volume(instrument) < 0.8 * 0.12 * 0.06


def test_no_letter_can_be_taken_for_another():
    alphabet = sorted(set("".join((*build.LEFT, *build.RIGHT, *build.FRIEZE))) - {"·"})
    drawn = {letter: cut((40, 40), [letter], stroke=1.0) for letter in alphabet}
    for one in alphabet:
        for other in alphabet:
            assert one == other or np.abs(drawn[one] - drawn[other]).mean() > 0.02, (one, other)


def volume(mesh: Mesh) -> float:
    """By the divergence theorem: positive where faces look outwards; a floor at 0 adds nothing."""
    a, b, c = np.array(mesh.vertices)[np.array(mesh.faces)].transpose(1, 0, 2)
    return float((a * np.cross(b, c)).sum() / 6)
