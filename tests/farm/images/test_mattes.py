"""Cryptomattes in films: pairs of an id and its samples, joined by ids and ranked in an image."""

from dataclasses import replace

import numpy as np
import pytest

from plateau.farm.images.channels import Channels
from plateau.farm.images.crops import crop_header
from plateau.farm.images.exr import decode_header, decode_partial, encode_partial
from plateau.farm.images.mattes import check_attributes, mattes
from plateau.picture.merge import Merge
from tests.support.images.plain_exr import partial_of

LAYERS = tuple(f"layer.CryptoObject{rank:02}.{letter}" for rank in range(2) for letter in "rgba")
NAMES = ("R", "G", "B", "W", *LAYERS)
CHANNELS = Channels(NAMES)
BALL, CUBE, FLOOR, HAIR, DUST = (
    np.array(bits, np.uint32).view(np.float32).item()
    for bits in (0x74D3EBE9, 0xA8FCE865, 0x3913209D, 0x055EC73D, 0x78D05529)
)


def film(*pixels):
    """A row of pixels of four samples each, with pairs of an id and its samples."""
    row = [[0, 0, 0, 4, *(one for pair in pairs for one in pair)] for pairs in pixels]
    return np.array([[pixel + [0] * (len(NAMES) - len(pixel)) for pixel in row]], np.float32)


def pairs(*films):
    """What the image of these films says of each pixel: ids, and their shares."""
    total = None
    for one in films:
        total = CHANNELS.add(total, one)
    image = CHANNELS.normalised(total)
    row = np.stack([image[name][0] for name in LAYERS], axis=-1)
    return [
        [(name, share) for name, share in zip(pixel[::2], pixel[1::2], strict=True) if share]
        for pixel in row.tolist()
    ]


def test_pairs_are_joined_by_their_ids_whatever_their_ranks():
    first = film([(BALL, 4)], [(BALL, 3), (CUBE, 1)], [], [(FLOOR, 2)])
    second = film([(BALL, 4)], [(CUBE, 3), (BALL, 1)], [(HAIR, 1)], [(BALL, 3), (FLOOR, 1)])
    third = film([(BALL, 4)], [(CUBE, 4)], [], [(BALL, 4)])
    assert pairs(first, second, third) == [
        [(BALL, 1)],
        [(CUBE, pytest.approx(8 / 12)), (BALL, pytest.approx(4 / 12))],
        [(HAIR, pytest.approx(1 / 12))],
        [(BALL, pytest.approx(7 / 12)), (FLOOR, pytest.approx(3 / 12))],
    ]


def test_a_pixel_with_too_many_things_keeps_those_with_most_samples():
    crowd = film([(BALL, 1.5), (CUBE, 1), (FLOOR, 1), (HAIR, 0.5)])
    assert pairs(crowd, film([(DUST, 2)])) == [
        [(DUST, 0.25), (BALL, 0.1875), (CUBE, 0.125), (FLOOR, 0.125)]
    ]
    assert pairs(crowd, film([(DUST, 0.25)])) == pairs(crowd, film([]))


def test_a_film_that_lacks_guides_has_its_mattes():
    whole = Channels((*NAMES[:4], "albedo.R", *LAYERS))
    total = whole.add(None, np.insert(film([(BALL, 4)]), 4, 2, axis=-1))
    total = whole.add_part(total, film([(CUBE, 3), (BALL, 1)]), CHANNELS)
    image = whole.normalised(total)
    assert [image[name].item() for name in (*LAYERS[:4], "albedo.R")] == [
        *(BALL, 0.625, CUBE, 0.375, 0.5)
    ]


def test_channels_that_are_no_whole_matte_are_sums():
    assert mattes(NAMES) == (tuple(range(4, 12)),)
    assert mattes(NAMES[:-1]) == ()
    channels = Channels(NAMES[:-1])
    assert channels.exact == ()
    total = channels.add(channels.add(None, film([(2, 1)])[..., :-1]), film([(4, 3)])[..., :-1])
    assert total[0, 0, 4:6].tolist() == [6, 4]
    assert CHANNELS.exact == LAYERS


def test_an_image_says_what_its_ids_are():
    names = {
        "cryptomatte/542cafa/name": "layer.CryptoObject",
        "cryptomatte/542cafa/manifest": '{"Ball":"74d3ebe9","Würfel":"a8fce865"}',
        **crop_header((5, 7), (32, 24)),
    }
    merge = Merge(slice_spp=4)
    for index, said in enumerate((names, {})):
        channels = replace(CHANNELS, quotients=((LAYERS[0], LAYERS[1]),))
        partial = partial_of(film([(BALL, 4)]), index, spp=4, channels=channels, header=said)
        content = encode_partial(partial)
        merge.add_partial(decode_partial(content))
        assert names.items() <= decode_header(content).items() or index
    # Then a monitor that goes on from a checkpoint knows it, too
    other = Merge(slice_spp=4)
    other.restore(merge.slices, merge.arrays(), merge.about())
    assert merge.header == other.header == names
    assert merge.channels == other.channels


@pytest.mark.parametrize(
    "attributes",
    [
        {"plateau:job": "another"},
        {"cryptomatte/542cafa/owner": "x"},
        {"cryptomatte/542cafa/name": 5},
        {"cryptomatte/542cafa/manifest": "x" * 2**24},
    ],
)
def test_a_render_child_says_nothing_else_in_the_header(attributes):
    with pytest.raises(ValueError, match="Cryptomatte"):
        check_attributes(attributes)
