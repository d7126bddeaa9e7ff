"""The view transform of a scene, as a table: what is seen through it, and what is no table."""

import numpy as np
import pytest

from plateau.farm.images.exr import decode_partial, encode_partial
from plateau.farm.images.view_transform import SIZE, ViewTransform
from plateau.metric import encode_srgb
from plateau.picture.merge import Merge
from tests.support.images.plain_exr import partial_of
from tests.support.images.view_transforms import srgb_transform


@pytest.fixture
def image() -> np.ndarray:
    return np.random.default_rng(7).uniform(0, 1.5, (40, 30, 3)).astype(np.float32)


@pytest.mark.parametrize("gain", [1.0, 0.125, 4.0])
def test_through_srgb_itself_an_image_is_seen_as_it_is(image, gain):
    seen = srgb_transform(gain).seen(image)
    # An eighth of a radiance is seen where the gain is one: what matters is the codes
    off = encode_srgb(seen).astype(int) - encode_srgb(np.clip(image * gain, 0, 1))
    assert np.abs(off).max() <= 1
    assert seen.dtype == np.float32


def test_the_exposure_acts_before_the_transform(image):
    look = srgb_transform(power=2)
    brighter = encode_srgb(look.seen(image, 1.0), exposure_ev=1.0).astype(int)
    assert np.abs(brighter - encode_srgb(look.seen(2 * image))).max() <= 1


def test_what_is_not_finite_stays(image):
    image[3, 4, 1], image[5, 6] = np.nan, np.inf
    seen = srgb_transform().seen(image)
    assert np.isnan(seen[3, 4, 1])
    assert np.isinf(seen[5, 6]).all()
    assert np.isfinite(seen).sum() == seen.size - 4


def test_it_survives_text_and_the_first_slice_of_a_job(image):
    look = srgb_transform(0.5, 2)
    again = ViewTransform.from_text(look.as_text())
    assert (again.gain, again.table.tobytes()) == (0.5, look.table.tobytes())
    film = np.concatenate([image, np.ones((40, 30, 1), np.float32)], axis=-1)
    merge = Merge(slice_spp=1)
    for index in range(2):
        partial = partial_of(film, index, transform=look if index == 0 else None)
        merge.add_partial(decode_partial(encode_partial(partial)))
    # The image and its halves are seen through it, and what is delivered is linear
    np.testing.assert_array_equal(merge.image(), look.seen(image))
    halves = merge.halves()
    assert halves is not None
    np.testing.assert_array_equal(halves[1].mean, look.seen(image))
    np.testing.assert_array_equal(merge.layers()["G"], image[..., 1])
    # A checkpoint has it
    restored = Merge(slice_spp=1)
    restored.restore(2, merge.arrays(), merge.about())
    np.testing.assert_array_equal(restored.image(), merge.image())
    # And a denoiser has the image as rendered
    np.testing.assert_array_equal(merge.image(as_seen=False), image)


@pytest.mark.parametrize("text", ["", "1.0", "1.0 AAAA", "0.0 {}", "nan {}", "1.0 {}AA=="])
def test_what_is_no_table_is_refused(text):
    packed = srgb_transform().as_text().partition(" ")[2]
    if text == "1.0 {}AA==":  # a short one
        packed = packed[:400]
    with pytest.raises(ValueError, match="no table of a view transform"):
        ViewTransform.from_text(text.format(packed))
    assert SIZE == 33
