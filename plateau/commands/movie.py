"""`plateau movie`: the pictures of a batch as a movie."""

import json
from collections.abc import Iterator, Sequence
from fractions import Fraction
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from rich.console import Console
from rich.progress import track

from plateau.client import ApiError, Client
from plateau.commands.batches import in_order
from plateau.commands.connect import connect
from plateau.errors import CommandFailed, tell
from plateau.farm.wire.views import JobView
from plateau.files.movie import SUFFIXES, write_movie
from plateau.files.sequence import frames_of


def movie(name: str, out: Path, *, rate: str, url: str | None, as_json: bool) -> None:
    """Write the movie of a batch's newest pictures, and print what it is."""
    if out.suffix not in SUFFIXES:
        raise CommandFailed(f"-o {out} names no movie: let it end with {', '.join(SUFFIXES)}")
    pace = _rate(rate)
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
        print(json.dumps({**told, "without_image": pictures.missing, "unfinished": open_ones}))
        return
    print(f"{out}: {pictures.shown} frames, {seconds:.3g} s at {float(pace):.6g} frames per second")


def _rate(text: str) -> Fraction:
    try:
        rate = Fraction(text)
    except (ValueError, ZeroDivisionError):
        rate = Fraction(0)
    if not Fraction(1, 10) <= rate <= 1000 or rate.denominator > 100_000:
        raise CommandFailed(f"--fps is a number such as 24, 29.97 or 30000/1001, not {text!r}")
    return rate


class _Pictures:
    """The pictures of the frames; the one before stands in for a frame that has none."""

    def __init__(self, client: Client, frames: Sequence[JobView]) -> None:
        self._client = client
        self._frames = frames
        self.shown = 0
        self.missing: list[str] = []  #: the jobs without an image

    def __iter__(self) -> Iterator[NDArray[np.uint8]]:
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

    def _picture(self, frame: JobView) -> NDArray[np.uint8] | None:
        try:
            content = self._client.image(frame.id)
        except ApiError as error:
            if error.slug != "no-image-yet":
                raise
            return None
        with Image.open(BytesIO(content), formats=("PNG",)) as picture:
            return np.asarray(picture.convert("RGB"))
