"""Movies, as players decode them."""

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from plateau.errors import CommandFailed
from plateau.files.movie import SUFFIXES, write_movie
from tests.support.images.movies import pictures


def ramps(count: int = 5, height: int = 47, width: int = 63) -> Iterator[NDArray[np.uint8]]:
    """Red rises to the right, green downwards, blue from picture to picture."""
    for number in range(count):
        picture = np.empty((height, width, 3), np.uint8)
        picture[..., 0] = np.linspace(0, 255, width)
        picture[..., 1] = np.linspace(0, 255, height)[:, None]
        picture[..., 2] = 50 * number
        yield picture


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_movie_shows_the_pictures_in_their_colours(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"ramps{suffix}"
    rate = Fraction(30_000, 1001)
    write_movie(ramps(), path, rate)
    assert list(tmp_path.iterdir()) == [path]
    with av.open(str(path)) as movie:
        (stream,) = movie.streams
        assert stream.average_rate == rate
        shown = [picture.astype(int) for picture in pictures(movie, "rgb24")]
    for frame, picture in zip(shown, ramps(), strict=True):
        assert frame.shape == (48, 64, 3)  # H.264 and VP9 halve the sides of colour
        # A wrong matrix or range of colours would differ by ten and more
        assert np.abs(frame[:47, :63] - picture).mean() < 3


def test_a_movie_that_cannot_be_whole_is_not_there(tmp_path: Path) -> None:
    def growing() -> Iterator[NDArray[np.uint8]]:
        yield from ramps(2)
        yield from ramps(1, width=64)

    with pytest.raises(CommandFailed, match="picture 2 of the movie is 64×47, and those before"):
        write_movie(growing(), tmp_path / "m.mp4", Fraction(24))
    with pytest.raises(FileNotFoundError):
        write_movie(ramps(), tmp_path / "none" / "m.mp4", Fraction(24))
    assert not list(tmp_path.iterdir())
