"""Films of named channels: what is added, what stays that of the first film, what is divided."""

import numpy as np
import pytest

from plateau.farm.images.channels import MOST_CHANNELS, Channels

NAMES = ("R", "G", "B", "W", "A", "Z", "id.shape")
CHANNELS = Channels(NAMES, ("id.shape",))


def film(*values):
    """A film of one pixel."""
    return np.array([[values]], np.float32)


def test_light_is_divided_by_the_colour_of_the_surface_in_an_image_alone():
    names = ("R", "G", "B", "W", "light.R", "colour.R")
    channels = Channels(names, (), [["light.R", "colour.R"]])
    # Given a pixel that is half of a bright surface in light and half of a dark one in shadow
    total = channels.add(None, film(0, 0, 0, 2, 1.8, 1.8))
    total = channels.add(total, film(0, 0, 0, 2, 0, 0.2))
    image = channels.normalised(total)
    # Then what remains of the light, times the colour, is the light
    assert image["light.R"].item() == pytest.approx(0.9)
    assert image["colour.R"].item() == pytest.approx(0.5)
    # And a black surface has none
    black = channels.normalised(channels.add(None, film(0, 0, 0, 2, 1.8, 0)))
    assert black["light.R"].item() == 0


@pytest.mark.parametrize(
    ("names", "more"),
    [
        (("R", "G", "B", "W", "A", "id.shape"), (3, 2, 1, 6, 3, 7)),
        (("R", "G", "B", "W", "A", "id.shape", "Z"), (3, 2, 1, 6, 3, 7, 24)),
    ],
)
def test_a_film_without_some_channels_has_the_mean_of_the_sum(names, more):
    total = CHANNELS.add(None, film(1, 2, 3, 2, 1, 8, 5))
    total = CHANNELS.add_part(total, film(*more), Channels(names, ("id.shape",)))
    assert total.tolist() == [[[4, 4, 4, 8, 4, 32, 5]]]
    assert CHANNELS.normalised(total)["Z"].item() == 4


def test_what_no_sample_has_reached_has_no_mean():
    total = CHANNELS.add_part(
        np.zeros((1, 1, 7)), film(1, 1, 1, 1, 1, 5), Channels(NAMES[:5] + NAMES[6:], ("id.shape",))
    )
    assert total.tolist() == [[[1, 1, 1, 1, 1, 0, 0]]]


def test_a_sum_in_float64_does_not_lose_small_films():
    channels, total = Channels(), None
    for value in (1.0, *[2.0**-30] * 64):
        total = channels.add(total, film(value, value, value, 1))
    assert total[0, 0, 0] == 1 + 2.0**-24


def test_a_pixel_that_is_not_finite_stays_so_in_its_channel_alone():
    total = CHANNELS.add(None, film(1, 1, 1, 1, np.nan, np.inf, 5))
    total = CHANNELS.add(total, film(1, 1, 1, 1, 1, -np.inf, 5))
    image = CHANNELS.normalised(total)
    assert np.isnan(image["A"]).all()
    assert np.isnan(image["Z"]).all()
    assert image["R"] == 1


def test_alpha_is_judged_and_aovs_are_not():
    assert (Channels().judged, Channels().aovs) == (4, ())
    assert (CHANNELS.judged, CHANNELS.aovs) == (5, ("Z", "id.shape"))


@pytest.mark.parametrize(
    ("names", "ids", "why"),
    [
        (("R", "G", "B"), (), "begin with R, G, B and W"),
        (("R", "G", "B", "W", "Z", "A"), (), "A follows W"),
        (("R", "G", "B", "W", "Z", "Z"), (), "two channels have one name"),
        (("R", "G", "B", "W", ""), (), "is no name of a channel"),
        (("R", "G", "B", "W", "a\nb"), (), "is no name of a channel"),
        (("R", "G", "B", "W", "x" * 161), (), "is no name of a channel"),
        (("R", "G", "B", "W", *map(str, range(MOST_CHANNELS))), (), "at most 128 channels"),
        (("R", "G", "B", "W", "Z"), ("id.shape",), "ids are AOVs"),
        (("R", "G", "B", "W"), ("R",), "ids are AOVs"),
        ("RGBW", (), "no list of names"),
        (("R", "G", "B", 4), (), "no list of names"),
    ],
)
def test_what_is_no_film_is_refused(names, ids, why):
    with pytest.raises(ValueError, match=why):
        Channels(names, ids)


@pytest.mark.parametrize("quotients", [[["Z", "albedo.R"]], [["Z"]], ["Z"], [["R", "Z"]], 3])
def test_what_is_no_pair_of_aovs_is_no_quotient(quotients):
    with pytest.raises(ValueError, match="pairs of AOVs"):
        Channels(("R", "G", "B", "W", "Z"), (), quotients)
