"""Which picture an EXR file holds: layers, parts, windows, and files that hold none."""

import io
from typing import Any

import numpy as np
import OpenEXR
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plateau.farm.images.exr import decode_image
from tests.support.images.plain_exr import encode_image

RNG = np.random.default_rng(9)
RED, GREEN, BLUE = RNG.random((3, 4, 5), np.float32)
PLAIN = {"R": RED, "G": GREEN, "B": BLUE}
ALBEDO = {f"albedo.{name}": plane / 2 for name, plane in PLAIN.items()}
IMAGE = np.stack([RED, GREEN, BLUE], axis=-1)


def exr(*parts: tuple[dict[str, Any], dict[str, Any]]) -> bytes:
    """A file of such parts: header and channels."""
    made = [
        OpenEXR.Part({"type": OpenEXR.scanlineimage, **header}, dict(channels))
        for header, channels in parts
    ]
    stream = io.BytesIO()
    with OpenEXR.File(made) as file:
        file.write(stream)
    return stream.getvalue()


def test_the_plain_channels_are_the_picture() -> None:
    content = exr(({}, {**PLAIN, **ALBEDO, "A": RED}))
    assert np.array_equal(decode_image(content), IMAGE)
    assert np.array_equal(decode_image(content, "albedo"), IMAGE / 2)


def test_an_only_layer_needs_no_name() -> None:
    assert np.array_equal(decode_image(exr(({}, ALBEDO))), IMAGE / 2)


def test_several_layers_without_a_plain_one_are_listed() -> None:
    diffuse = {f"diffuse.{name}": plane for name, plane in PLAIN.items()}
    with pytest.raises(ValueError, match="choose one of albedo, diffuse with --layer"):
        decode_image(exr(({}, {**ALBEDO, **diffuse})))


def test_a_layer_that_is_not_there_is_answered_with_those_that_are() -> None:
    with pytest.raises(ValueError, match="no layer 'glossy'; it has the plain R, G, B, albedo"):
        decode_image(exr(({}, {**PLAIN, **ALBEDO})), "glossy")


def test_a_part_is_a_layer_by_its_name() -> None:
    content = exr(({"name": "beauty"}, PLAIN), ({"name": "light"}, {"Y": GREEN}))
    assert np.array_equal(decode_image(content), IMAGE)
    assert np.array_equal(decode_image(content, "light"), np.stack([GREEN] * 3, axis=-1))


def test_luminance_and_chroma_are_refused() -> None:
    with pytest.raises(ValueError, match="luminance and chroma"):
        decode_image(exr(({}, {"Y": RED, "RY": GREEN, "BY": BLUE})))


def windows(data: tuple[int, int], display: tuple[int, int, int, int]) -> dict[str, Any]:
    x, y = data
    left, top, right, bottom = display
    return {
        "dataWindow": (np.array([x, y], np.int32), np.array([x + 4, y + 3], np.int32)),
        "displayWindow": (np.array([left, top], np.int32), np.array([right, bottom], np.int32)),
    }


def test_what_lies_in_the_display_window_is_seen() -> None:
    larger = decode_image(exr((windows((2, 1), (0, 0, 9, 7)), PLAIN)))
    assert larger.shape == (8, 10, 3)
    assert np.array_equal(larger[1:5, 2:7], IMAGE)
    assert larger.sum() == pytest.approx(IMAGE.sum(), rel=1e-5)
    smaller = decode_image(exr((windows((0, 0), (1, 1, 2, 3)), PLAIN)))
    assert np.array_equal(smaller, IMAGE[1:4, 1:3])


def test_a_data_window_beside_the_display_window_shows_nothing() -> None:
    assert not decode_image(exr((windows((20, 20), (0, 0, 4, 3)), PLAIN))).any()


WHOLE = [encode_image(IMAGE), exr(({}, {**PLAIN, **ALBEDO}))]


@given(st.sampled_from(WHOLE), st.data())
def test_a_damaged_file_is_read_or_refused_in_words(whole: bytes, data: st.DataObject) -> None:
    # Beyond the header: what OpenEXR makes of a damaged one is for a process of its own.
    start = len(whole) // 2
    damaged = bytearray(whole[: data.draw(st.integers(start, len(whole)))])
    for _ in range(data.draw(st.integers(0, 3)) if len(damaged) > start else 0):
        damaged[data.draw(st.integers(start, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    try:
        assert decode_image(bytes(damaged)).shape[-1] == 3
    except ValueError as error:
        if "EXR" not in str(error):
            raise


def test_a_vector_is_no_luminance() -> None:
    with pytest.raises(ValueError, match=r"no R, G and B channels, only N\.X, N\.Y, N\.Z"):
        decode_image(exr(({}, {"N.X": RED, "N.Y": GREEN, "N.Z": BLUE})))
