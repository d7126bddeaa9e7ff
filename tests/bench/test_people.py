"""What the benchmark of people says of thresholds that are known."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

from bench import people
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.noise_model import NoiseModel

ROOM = '<scene><sensor><float name="fov" value="35" /><matrix value="1 0" /></sensor></scene>'


def test_a_zone_needs_as_many_samples_as_its_noise_has_energy() -> None:
    # Given noise that is twice as strong in the lower half
    noise = np.random.default_rng(1).normal(0, 0.02, (people.PIXELS, people.PIXELS, 3))
    noise[people.PIXELS // 2 :] *= 2
    grey = np.full(noise.shape, 0.4, np.float32)
    model = NoiseModel(grey, noise.astype(np.float32), np.zeros(noise.shape[:2], np.bool_))
    metric = CompiledVisibleDifferences(people.LOOK)
    strong, half = (people.lost(metric, model, amount) for amount in (1.0, 0.5))
    # Then half the noise loses there what all of it loses above
    for name in people.ALLOWED:
        assert half[name][8:] == pytest.approx(strong[name][:8], rel=0.2), name
        assert strong[name][8:].min() > strong[name][:8].max()


def test_ranks_and_misfits_are_those_of_textbooks() -> None:
    said = np.array([100.0, 200, 400, 400])
    assert people.rank(said, said[::-1]) == pytest.approx(-8 / 9)
    assert people.misfit(7 * said, said) == pytest.approx(0, abs=0.01)
    # More than was rendered for people is no mistake
    assert people.misfit(np.array([1e4, 9e4]), np.full(2, people.MOST_SPP)) == 0


def test_a_room_is_seen_from_the_camera_of_the_view(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "room.zip", "w") as file:
        file.writestr("scene.xml", ROOM)
    scene = people.scene_of(tmp_path / "room.zip", tmp_path / "room", ("0, 1, 2", "3, 4, 5", "65"))
    assert '<lookat origin="0, 1, 2" target="3, 4, 5"' in Path(scene).read_text()
    assert 'value="65"' in Path(scene).read_text()
