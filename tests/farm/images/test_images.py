"""Partials and images survive their EXR files; broken files are refused in words."""

import io
from dataclasses import replace
from typing import get_args

import numpy as np
import OpenEXR
import pytest

from plateau.farm.images.channels import Channels
from plateau.farm.images.exr import (
    Partial,
    decode_image,
    decode_layers,
    decode_partial,
    encode_layers,
    encode_partial,
)
from plateau.farm.model.errors import CorruptPartial
from plateau.farm.model.spec.parts import Compression
from tests.support.images.plain_exr import encode_image, partial_of

RNG = np.random.default_rng(7)


def a_partial() -> Partial:
    pixels = RNG.normal(size=(5, 7, 4)).astype(np.float32)
    pixels[0, 0] = [np.nan, np.inf, -0.0, 1e-42]
    seeds = {"first_seed": 2**32 - 2, "last_seed": 2**32 - 1}
    return partial_of(pixels, 3, **seeds, spp=25, scene_sha256="ab" * 32)


def test_a_partial_comes_back_to_the_bit() -> None:
    partial = a_partial()
    back = decode_partial(encode_partial(partial))
    assert back.pixels.tobytes() == partial.pixels.tobytes()
    for name in ("job_id", "index", "first_seed", "last_seed", "spp", "variant", "scene_sha256"):
        assert getattr(back, name) == getattr(partial, name)


def test_a_partial_keeps_the_order_of_its_channels_and_what_is_an_id() -> None:
    names = ("R", "G", "B", "W", "A", "albedo.R", "Z", "id.shape")
    channels = Channels(names, ("id.shape",), (("Z", "albedo.R"),))
    pixels = RNG.normal(size=(5, 7, 8)).astype(np.float32)
    partial = replace(a_partial(), pixels=pixels, channels=channels, renderer="mitsuba 3.9.1")
    back = decode_partial(encode_partial(partial))
    assert back.pixels.tobytes() == pixels.tobytes()
    assert (back.channels, back.renderer) == (channels, "mitsuba 3.9.1")


def test_a_partial_that_lacks_a_channel_it_names_is_refused() -> None:
    content = encode_partial(a_partial())
    named, longer = (f'["R", "G", "B", "{one}"'.encode() for one in ("W", "V"))
    with pytest.raises(CorruptPartial, match="begin with R, G, B and W"):
        decode_partial(content.replace(named, longer))


def test_half_cuts_what_is_finite_and_leaves_the_rest() -> None:
    values = np.array([[1e6, -1e6, 0.1, np.inf, -np.inf, np.nan]], np.float32)
    content = encode_layers({"R": values, "Z": values}, {}, precision="half", whole=("Z",))
    layers = decode_layers(content)
    expected = np.array([[65504, -65504, np.float16(0.1), np.inf, -np.inf, np.nan]], np.float32)
    np.testing.assert_array_equal(layers["R"], expected)
    np.testing.assert_array_equal(layers["Z"], values)


@pytest.mark.parametrize("compression", get_args(Compression))
def test_no_compression_loses_anything(compression: Compression) -> None:
    values = RNG.random((9, 4)).astype(np.float32)
    content = encode_layers({"Z": values}, {}, compression=compression)
    np.testing.assert_array_equal(decode_layers(content)["Z"], values)


@pytest.mark.parametrize("keep", [0, 3, 200, 0.5, 0.99])
def test_a_partial_cut_short_is_refused(keep: float) -> None:
    content = encode_partial(a_partial())
    short = content[: int(keep * len(content)) if keep < 1 else int(keep)]
    with pytest.raises(CorruptPartial):
        decode_partial(short)


def test_an_image_is_no_partial() -> None:
    with pytest.raises(CorruptPartial, match="plateau:channels"):
        decode_partial(encode_image(np.zeros((2, 2, 3), np.float32)))


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_half_alpha_and_grey_exrs_are_read(dtype: type) -> None:
    plane = RNG.random((3, 2)).astype(dtype)

    def exr(*names: str) -> bytes:
        stream = io.BytesIO()
        with OpenEXR.File({}, {name: plane.copy() for name in names}) as file:
            file.write(stream)
        return stream.getvalue()

    expected = np.stack([plane.astype(np.float32)] * 3, axis=-1)
    np.testing.assert_array_equal(decode_image(exr("R", "G", "B", "A")), expected)
    np.testing.assert_array_equal(decode_image(exr("Y")), expected)
