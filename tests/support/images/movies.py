"""Movies, as players decode them."""

from collections.abc import Iterator
from typing import Any

from av.container import InputContainer
from av.video.reformatter import VideoReformatter
from numpy.typing import NDArray


def pictures(movie: InputContainer, pixels: str) -> Iterator[NDArray[Any]]:
    """The pictures of a movie, with pixels of this format."""
    reformatter = VideoReformatter()  # as `plateau.files.movie` has one, for the same reason
    for frame in movie.decode(video=0):
        yield reformatter.reformat(frame, format=pixels).to_ndarray()
