"""PNG files of every kind give the code values that were written; broken ones give words."""

import io

import numpy as np
import png
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plateau.farm.images.png import decode_png, encode_png

RNG = np.random.default_rng(7)
WIDTH, HEIGHT = 9, 6
CHANNELS = {"grey": 1, "grey with alpha": 2, "colour": 3, "colour with alpha": 4}


def written(values: np.ndarray, *, bits: int, interlaced: bool) -> bytes:
    """A PNG file of (HEIGHT, WIDTH, channels) code values."""
    channels = values.shape[-1]
    writer = png.Writer(
        WIDTH,
        HEIGHT,
        greyscale=channels < 3,
        alpha=channels in {2, 4},
        bitdepth=bits,
        interlace=interlaced,
    )
    stream = io.BytesIO()
    writer.write_array(stream, values.ravel().tolist())
    return stream.getvalue()


KINDS = [(kind, bits) for kind in CHANNELS for bits in (8, 16)]
KINDS += [("grey", bits) for bits in (1, 2, 4)]


@pytest.mark.parametrize("interlaced", [False, True])
@pytest.mark.parametrize(("kind", "bits"), KINDS)
def test_every_kind_is_read_right(kind: str, bits: int, interlaced: bool) -> None:
    most = 2**bits - 1
    values = RNG.integers(0, most + 1, (HEIGHT, WIDTH, CHANNELS[kind]))
    read = decode_png(written(values, bits=bits, interlaced=interlaced))

    *colour, alpha = np.moveaxis(values, -1, 0) if "alpha" in kind else (*values.T, None)
    planes = [values[..., index] for index in range(len(colour))]
    expected = np.stack(planes * (3 // len(planes)), axis=-1) / most
    assert read.colour == pytest.approx(expected, abs=1e-6)
    if alpha is None:
        assert read.alpha is None
    else:
        assert read.alpha == pytest.approx(alpha / most, abs=1e-6)


def test_a_palette_is_looked_up_with_its_transparency() -> None:
    palette = [(255, 0, 0, 255), (0, 51, 255, 102)]
    stream = io.BytesIO()
    png.Writer(2, 1, palette=palette, bitdepth=1).write(stream, [[0, 1]])
    read = decode_png(stream.getvalue())
    assert read.colour[0] == pytest.approx(np.array([[1, 0, 0], [0, 0.2, 1]]))
    assert read.alpha is not None
    assert read.alpha[0] == pytest.approx([1, 0.4])


def test_an_opaque_alpha_is_none() -> None:
    assert decode_png(encode_png(np.full((2, 2, 4), 255, np.uint8))).alpha is None


def test_what_is_written_comes_back() -> None:
    picture = RNG.integers(0, 256, (6, 5, 3), np.uint8)
    assert np.array_equal(decode_png(encode_png(picture)).colour * 255, picture)


WHOLE = [
    written(RNG.integers(0, 2**bits, (HEIGHT, WIDTH, 4)), bits=bits, interlaced=False)
    for bits in (8, 16)
]


@given(st.sampled_from(WHOLE), st.data())
def test_a_damaged_file_is_read_or_refused_in_words(whole: bytes, data: st.DataObject) -> None:
    damaged = bytearray(whole[: data.draw(st.integers(0, len(whole)))])
    for _ in range(data.draw(st.integers(0, 3)) if damaged else 0):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    try:
        assert decode_png(bytes(damaged)).colour.shape[-1] == 3
    except ValueError as error:
        if "PNG" not in str(error):
            raise


def test_a_header_shorter_than_a_header_is_refused() -> None:
    damaged = bytearray(WHOLE[0])
    damaged[11] = 5  # its length, which was 13
    with pytest.raises(ValueError, match="not a readable PNG"):
        decode_png(bytes(damaged))
