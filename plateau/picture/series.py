"""Judges images that are rendered already, and says where each rule would have stopped.

A series is a folder of EXR files, in one of three forms:

- *slices* that a job kept: partials, which say themselves what they are;
- *images* of any renderer, each of so many samples of its own, in the order of their names;
- *cumulative* images, each of so many samples more than the one before and containing it.

All become slices, which are merged and judged by the same code that a job's are.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path

import numpy as np

from plateau.errors import PlateauError
from plateau.farm.images.channels import Channels
from plateau.farm.images.exr import Pixels, decode_header, decode_image, decode_partial
from plateau.farm.model.errors import CorruptPartial
from plateau.farm.model.job import CurvePoint
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.spec.parts import FrameAllocation
from plateau.picture.independence import Independence
from plateau.picture.judge import Judge
from plateau.picture.merge import Merge
from plateau.picture.result_files import non_finite_png


class CannotJudge(PlateauError):
    """The folder holds no series that can be judged; the message says why, in one line."""


class BrokenSeries(CannotJudge):
    """Too many pixels of the merged image are NaN or infinite.

    Attributes
    ----------
    picture
        A PNG file that shows where.
    """

    def __init__(self, flaw: str, picture: bytes) -> None:
        super().__init__(flaw)
        self.picture = picture


@dataclass(frozen=True)
class Series:
    """Slices to be merged in order."""

    files: tuple[Path, ...]
    spp: int  #: of each slice
    cumulative: bool
    partials: bool

    def films(self) -> Iterator[tuple[Pixels, Channels]]:
        """Each slice's film before normalisation, as `Merge.add` takes it: what is seen of it."""
        before, independence = np.zeros(()), Independence()
        for number, path in enumerate(self.files, start=1):
            if self.partials:
                partial = decode_partial(path.read_bytes())
                yield partial.pixels[..., : partial.channels.judged], partial.channels.seen()
                continue
            image, job = _image(path)
            if not self.cumulative:
                independence.add(str(path), image, job)
            total = image.astype(np.float64) * (self.spp * (number if self.cumulative else 1))
            colour = total - before if self.cumulative else total
            before = total
            weights = np.full((*image.shape[:2], 1), self.spp)
            yield np.concatenate([colour, weights], axis=-1).astype(np.float32), Channels()


@dataclass(frozen=True)
class Judged:
    """A series, judged."""

    points: list[CurvePoint]
    width: int
    height: int
    #: By rule: the spp at which it would have stopped; None where it would not have.
    stops: dict[str, int | None]


def find_series(folder: Path, *, image_spp: int | None, cumulative: bool) -> Series:
    """The series in a folder.

    Parameters
    ----------
    folder
        Its files that end in ``.exr`` are taken, by name; numbers in names count as numbers.
    image_spp
        Samples per pixel of each image, or between two cumulative ones; a job's slices know them.
    cumulative
        Whether each image contains the one before.

    Raises
    ------
    CannotJudge
        There are no EXR files, they are of several kinds or jobs, or a slice is missing.
    """
    files = tuple(sorted(folder.glob("*.exr"), key=_by_numbers))
    if not files:
        known = "has no .exr files" if folder.is_dir() else "is not a folder"
        raise CannotJudge(
            f"{folder} {known}: give the slices of a job that kept them, or images of any renderer"
        )
    try:
        first = decode_partial(files[0].read_bytes())
    except CorruptPartial:
        if image_spp is None:
            raise CannotJudge(
                f"{files[0].name} is no slice of a job: say how many samples per pixel each image "
                "has, with --slice-spp"
            ) from None
        return Series(files, image_spp, cumulative, partials=False)
    for index, path in enumerate(files):
        try:
            partial = decode_partial(path.read_bytes())
        except CorruptPartial as error:
            raise CannotJudge(f"{path}: {error}") from error
        if partial.job_id != first.job_id:
            raise CannotJudge(f"{path} is of job {partial.job_id}, not of {first.job_id}")
        if partial.zones:
            raise CannotJudge(f"{path} has parts of the image: judge a job that renders by frame")
        if partial.index != index:
            raise CannotJudge(f"{folder} lacks slice {index}: a series has no gaps")
    return Series(files, first.spp, cumulative=False, partials=True)


def judge_series(series: Series, spec: JobSpec) -> Judged:
    """Judge a series at each step of the spec, by its rule and by all that it watches.

    Raises
    ------
    CannotJudge
        A file cannot be read, sizes differ, or no evaluation falls on the series.
    BrokenSeries
        Too many of its pixels are NaN or infinite, as would fail a job.
    """
    whole = spec.model_copy(update={"allocation": FrameAllocation()})  # as each image is
    judge, merge = Judge(spec), replace(Merge.of(whole), slice_spp=series.spp)
    if series.partials:
        merge.transform = decode_partial(series.files[0].read_bytes()).transform
    points: list[CurvePoint] = []
    for path, film in zip(series.files, series.films(), strict=True):
        try:
            merge.add(*film)
            spec.require_size(film[0].shape[1], film[0].shape[0])
        except ValueError as error:
            raise CannotJudge(f"{path}: {error}") from error
        if merge.spp % spec.step == 0:
            now, judgement = datetime.now(timezone.utc), judge.judge(merge)
            if judgement.flaw is not None:
                picture = non_finite_png(merge.image(), spec.view.exposure_ev)
                raise BrokenSeries(f"{path}: at {merge.spp} spp {judgement.flaw}", picture)
            points.append(CurvePoint.model_validate({**judgement.point, "at": now}))
    if not points:
        raise CannotJudge(
            f"the series ends at {merge.spp} spp, before the first evaluation: lower --step "
            f"to a multiple of {series.spp}"
        )
    height, width = merge.image().shape[:2]
    stops = {
        name: next((point.spp for point in points if point.rules[name].stop), None)
        for name in points[0].rules
    }
    return Judged(points, width, height, stops)


def _image(path: Path) -> tuple[Pixels, str | None]:
    """Return an image, and the job of Plateau's that made it."""
    try:
        content = path.read_bytes()
        return decode_image(content), decode_header(content).get("plateau:job")
    except (OSError, ValueError) as error:
        raise CannotJudge(f"{path}: {error}") from error


def _by_numbers(path: Path) -> list[tuple[int, str]]:
    """So that ``image-9`` comes before ``image-10``."""
    parts = re.split(r"(\d+)", path.name)
    return [(int(part), "") if part.isdigit() else (-1, part) for part in parts]
