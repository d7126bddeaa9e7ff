"""Movies of a sequence's pictures, written by FFmpeg's libraries."""

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plateau.errors import CommandFailed, needs
from plateau.files.job_folder import whole

#: The encoder by a file's suffix, with a quality at which compression is hardly seen.
_ENCODERS: Final[dict[str, tuple[str, dict[str, str]]]] = {
    ".mp4": ("libx264", {"crf": "16"}),
    ".mov": ("libx264", {"crf": "16"}),
    ".webm": ("libvpx-vp9", {"crf": "20", "b:v": "0", "row-mt": "1"}),
}
SUFFIXES: Final = tuple(_ENCODERS)
_BT709: Final = 1  #: the number of Rec. 709 among matrices and among primaries, by ITU-T H.273
_SRGB: Final = 13  #: the number of sRGB among transfer characteristics, by ITU-T H.273
_LIMITED: Final = 1  #: the range of 16 to 235, as FFmpeg numbers it


def write_movie(pictures: Iterable[NDArray[np.uint8]], path: Path, rate: Fraction) -> None:
    """Write pictures as a movie that browsers and players show in the same colours.

    A file is written whole or not at all.

    Parameters
    ----------
    pictures : iterable of NDArray
        (height, width, 3) uint8 each, sRGB. Where a side is odd, the last row or column is doubled.
    path : Path
        The file; its suffix is one of `SUFFIXES`.
    rate : Fraction
        Pictures per second.

    Raises
    ------
    CommandFailed
        The pictures differ in size.
    ExtraMissing
        PyAV is not installed.
    OSError
        The file cannot be written.
    """
    with needs("movie"):
        import av
        from av.video.reformatter import VideoReformatter

    # A frame's own method keeps one for the thread. From Python 3.12 on a forked child frees those
    # of other threads, and waits for threads of the reformatter, which it does not have.
    reformatter = VideoReformatter()
    encoder, options = _ENCODERS[path.suffix]
    size: tuple[int, ...] | None = None
    stream: Any = None
    with whole(path) as unfinished, av.open(str(unfinished), "w", format=path.suffix[1:]) as file:
        for number, picture in enumerate(pictures):
            if stream is None:
                size = picture.shape
                stream = file.add_stream(encoder, rate=rate, options=options)
                stream.height, stream.width = (side + side % 2 for side in size[:2])
                stream.pix_fmt = "yuv420p"
                of = stream.codec_context
                of.colorspace = of.color_primaries = _BT709
                of.color_trc, of.color_range = _SRGB, _LIMITED
            if picture.shape != size:
                raise CommandFailed(
                    f"picture {number} of the movie is {_size(picture.shape)}, and those before "
                    f"are {_size(size or ())}"
                )
            even = np.pad(picture, [(0, size[0] % 2), (0, size[1] % 2), (0, 0)], mode="edge")
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(even), format="rgb24")
            shown = reformatter.reformat(
                frame, format="yuv420p", dst_colorspace=_BT709, dst_color_range=_LIMITED
            )
            shown.pts = number
            shown.time_base = 1 / rate
            file.mux(stream.encode(shown))
        if stream is not None:
            file.mux(stream.encode(None))


def _size(shape: tuple[int, ...]) -> str:
    return f"{shape[1]}×{shape[0]}"
