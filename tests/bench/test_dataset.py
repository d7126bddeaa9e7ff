"""The bench of many small images in small: what its ways make, not how fast they are."""

from pathlib import Path

import numpy as np
import pytest

from bench import dataset
from plateau.farm.images.exr import decode_image


@pytest.mark.long
def test_each_way_makes_the_same_images_of_a_camera_that_moves(tmp_path: Path) -> None:
    scene, found = dataset.moving(dataset.BOX, tmp_path), []
    for way in dataset.WAYS:
        with dataset.start(way, scene / way, "--case", "6", "16", "1024") as process:
            assert process.wait() == 0
        files = [(scene / way / f"{frame}.exr").read_bytes() for frame in range(6)]
        found.append(np.stack([decode_image(one).mean(axis=-1) for one in files]))
    # Most noise is gone from columns of 16 pixels
    columns = np.stack(found).mean(axis=2)
    assert np.allclose(columns, columns[0], rtol=0.1, atol=0.1)
    assert not np.allclose(columns[:, 0], columns[:, 5], rtol=0.1, atol=0.1)
