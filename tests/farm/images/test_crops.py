"""An EXR of a crop says where in its film it lies, as OpenEXR reads it."""

import io

import numpy as np
import OpenEXR
import pytest

from plateau.farm.images.crops import CROP, crop_header
from plateau.farm.images.exr import decode_image, decode_layers, encode_layers
from plateau.farm.images.mattes import check_attributes

PLANES = {
    name: np.arange(108, dtype=np.float32).reshape(9, 12) + place
    for place, name in enumerate(("R", "G", "B", "A", "Z"))
}
HEADER = crop_header((5, 7), (32, 24))


@pytest.mark.parametrize("precision", ["float", "half"])
def test_its_windows_are_those_of_the_crop_and_of_the_film(precision):
    content = encode_layers(PLANES, HEADER, precision=precision, whole=("Z",))
    with OpenEXR.File(io.BytesIO(content), separate_channels=True) as file:
        header = dict(file.header())
        found = {name: one.pixels for name, one in file.channels().items()}
    assert np.array_equal(header["dataWindow"], [[5, 7], [16, 15]])
    assert np.array_equal(header["displayWindow"], [[0, 0], [31, 23]])
    assert found.keys() == PLANES.keys()
    for name, plane in PLANES.items():
        np.testing.assert_array_equal(found[name], plane)


def test_its_pixels_are_the_crop_for_us():
    content = encode_layers(PLANES, HEADER)
    assert decode_image(content).shape == (9, 12, 3)
    assert decode_layers(content)["A"].shape == (9, 12)


def test_what_is_no_place_is_refused():
    check_attributes(HEADER)
    with pytest.raises(ValueError, match="no place in a film"):
        check_attributes({CROP: "5 7"})
