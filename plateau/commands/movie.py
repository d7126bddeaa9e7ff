"""`plateau movie`: the pictures of a batch as a movie."""

from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.commands.connect import connect
from plateau.commands.printing import print_json
from plateau.commands.watch import in_order
from plateau.errors import CommandFailed, tell

if TYPE_CHECKING:
    from fractions import Fraction

    import numpy as np
    from numpy.typing import NDArray

    from plateau.client import Client
    from plateau.farm.wire.views import JobView


@app.command()
def movie(
    name: Annotated[str, typer.Argument(help="The batch's name.", metavar="NAME")],
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", metavar="FILE", help="The movie: .mp4 or .mov (H.264), or .webm (VP9)."
        ),
    ],
    fps: Annotated[
        str, typer.Option(metavar="RATE", help="Frames per second, such as 29.97 or 30000/1001.")
    ] = "24",
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Write the pictures of a batch as a movie.

    For example:
      plateau movie walk -o walk.mp4
      plateau watch --batch walk && plateau movie walk -o walk.webm --fps 30

    Frames play by the parameter that tells them apart, if it is a number, or else as they were
    submitted; of a frame that was rendered again the newest job counts. While a batch is rendered,
    its frames are as they are now, and the one before stands in for a frame without an image.
    """
    from plateau.files.movie import SUFFIXES, write_movie
    from plateau.files.sequence import frames_of

    if out.suffix not in SUFFIXES:
        raise CommandFailed(f"-o {out} names no movie: let it end with {', '.join(SUFFIXES)}")
    pace = _rate(fps)
    with connect(url) as client:
        frames = frames_of(in_order(client, client.batch(name)))
        open_ones = sum(frame.finished_at is None for frame in frames)
        pictures = _Pictures(client, frames)
        write_movie(pictures, out, pace)
    if open_ones:
        tell(f"{open_ones} of {len(frames)} frames are not finished: they are as they are now")
    seconds = float(pictures.shown / pace)
    if as_json:
        told = {"file": str(out), "frames": pictures.shown, "seconds": seconds}
        print_json({**told, "without_image": pictures.missing, "unfinished": open_ones})
        return
    print(f"{out}: {pictures.shown} frames, {seconds:.3g} s at {float(pace):.6g} frames per second")


def _rate(text: str) -> "Fraction":
    from fractions import Fraction

    try:
        rate = Fraction(text)
    except (ValueError, ZeroDivisionError):
        rate = Fraction(0)
    if not Fraction(1, 10) <= rate <= 1000 or rate.denominator > 100_000:
        raise CommandFailed(f"--fps is a number such as 24, 29.97 or 30000/1001, not {text!r}")
    return rate


class _Pictures:
    """The pictures of the frames; the one before stands in for a frame that has none."""

    def __init__(self, client: "Client", frames: "Sequence[JobView]") -> None:
        self._client = client
        self._frames = frames
        self.shown = 0
        self.missing: list[str] = []  #: the jobs without an image

    def __iter__(self) -> "Iterator[NDArray[np.uint8]]":
        from rich.console import Console
        from rich.progress import track

        last: NDArray[np.uint8] | None = None
        console = Console(stderr=True)
        for frame in track(
            self._frames, "frames", console=console, transient=True, disable=not console.is_terminal
        ):
            found = self._picture(frame)
            if found is None:
                self.missing.append(frame.id)
                what = "no picture stands" if last is None else "the picture before stands"
                tell(f"{frame.title} has no image: {what} in for it")
            last = last if found is None else found
            if last is not None:
                self.shown += 1
                yield last
        if last is None:
            raise CommandFailed(
                "no job of the batch has an image yet: `plateau watch` waits for it"
            )

    def _picture(self, frame: "JobView") -> "NDArray[np.uint8] | None":
        import numpy as np
        from PIL import Image

        from plateau.client import ApiError

        try:
            content = self._client.image(frame.id)
        except ApiError as error:
            if error.slug != "no-image-yet":
                raise
            return None
        with Image.open(BytesIO(content), formats=("PNG",)) as picture:
            return np.asarray(picture.convert("RGB"))
