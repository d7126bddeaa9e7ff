"""Movies, as players decode them."""

from collections.abc import Iterator
from typing import Any

from av.container import InputContainer
from av.video.reformatter import VideoReformatter
from numpy.typing import NDArray


def pictures(movie: InputContainer, pixels: str) -> Iterator[NDArray[Any]]:
    """The pictures of a movie, with pixels of this format.

    PyAV's own reformatter stays in a variable of the thread. From Python 3.13 on a forked child
    frees those of other threads, and waits for threads of the reformatter, which it does not have.
    """
    reformatter = VideoReformatter()
    for frame in movie.decode(video=0):
        yield reformatter.reformat(frame, format=pixels).to_ndarray()
