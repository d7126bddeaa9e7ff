"""The files that a job leaves with its user."""

import hashlib
import json
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol, TypeVar

from plateau.client import ApiError
from plateau.errors import CommandFailed
from plateau.farm.model.job import CurvePoint, utc_now
from plateau.farm.wire import job_text
from plateau.farm.wire.csv_text import curve_csv
from plateau.farm.wire.curve_svg import STYLE, job_svg
from plateau.farm.wire.views import JobView, SliceView
from plateau.files.job_folder import IMAGES, SLICES, NewSet

_KEPT: Final = "plateau-kept-"

_Written = TypeVar("_Written")


class Source(Protocol):
    """What has the results of a job: a client of its service."""

    def curve(self, job_id: str, /) -> list[CurvePoint]:
        """The points of its curve."""

    def slices(self, job_id: str, /) -> list[SliceView]:
        """Its ledger."""

    def download(self, job_id: str, name: str, path: Path, /) -> None:
        """Write one of its files; raises `ApiError` ``no-image-yet`` if there is none."""


def write_results(client: Source, job: JobView, folder: Path) -> dict[str, Any]:
    """Write all that is known of an ended job into a folder; returns the summary as JSON.

    These are ``image.exr``, ``image.png``, ``difference.png`` and ``noise.png``, where the job has
    an image and its maps; ``spp.png``, where it is allocated by zones; ``non-finite.png``, where
    the image is NaN or infinite anywhere; ``curve.csv`` and ``curve.svg``, where its curve has
    points; ``slices``, where it kept them, for `plateau judge`; ``summary.txt`` and
    ``summary.json``. Slices that are there already are not fetched again. What another job has left
    there is replaced when all is there; after an error it is as it was. See `out_folder`.

    Raises
    ------
    OSError
        They cannot be written; its `filename` is the folder's where it is no file's.
    CommandFailed
        All but some were written: those are damaged in the service's store.
    """
    try:
        return _write(client, job, folder, _Place(folder, keeps=False))
    except OSError as error:
        if error.strerror and error.filename is None:  # a full disk says no name
            error.filename = str(folder)
        raise


def write_or_keep(client: Source, job: JobView, folder: Path) -> dict[str, Any]:
    """The same for a job that is gone with its service: what cannot be written is kept elsewhere.

    Raises
    ------
    CommandFailed
        The folder did not take them; the message names the temporary folder that has them. Or
        some files are damaged in the service's store.
    """
    return _write(client, job, folder, _Place(folder, keeps=True))


class _Place:
    """Where the files of a set are, until it cannot be written; then a fresh temporary folder."""

    def __init__(self, folder: Path, *, keeps: bool) -> None:
        self.new: Final = NewSet(folder)
        self.folder = self.new.place
        self.trouble: OSError | None = None
        self._keeps = keeps

    def take(self, write: Callable[[Path], _Written]) -> _Written:
        try:
            return write(self.folder)
        except OSError as error:
            if self.trouble is not None or not self._keeps:
                raise
            self.folder, self.trouble = Path(tempfile.mkdtemp(prefix=_KEPT)), error
            if self.new.place.exists():
                shutil.copytree(self.new.place, self.folder, dirs_exist_ok=True)
            return write(self.folder)


def _write(client: Source, job: JobView, folder: Path, place: _Place) -> dict[str, Any]:
    new = place.new
    slices = _slices(client, job)
    kept = {name for name in slices if _is_one_of(slices, folder / SLICES / name)}
    try:
        place.take(lambda there: new.begin() if there == new.place else None)
        fetched = place.take(lambda there: _fetch(client, job, there, slices, kept))
        about = place.take(
            lambda there: _summarise(job, fetched, there, folder if there == new.place else there)
        )
        place.take(lambda there: new.commit(job.id, kept) if there == new.place else None)
    except BaseException:
        if not (new.place / SLICES).exists():
            new.drop()
        raise
    if place.trouble is not None:
        new.drop()
        raise CommandFailed(
            f"the results could not be written into {folder} "
            f"({place.trouble.strerror or place.trouble}): they are in {place.folder}; move them "
            "to where you want them"
        )
    if fetched.damaged:
        raise CommandFailed("\n".join(fetched.damaged.values()))
    return about


@dataclass(frozen=True)
class _Fetched:
    points: list[CurvePoint]
    files: list[str]
    damaged: dict[str, str]  #: what the service says of each file that it does not have whole


def _fetch(
    client: Source, job: JobView, folder: Path, slices: dict[str, SliceView], kept: set[str]
) -> _Fetched:
    fetched = _Fetched(client.curve(job.id), [], {})
    for name in IMAGES:
        if _download(client, job.id, name, folder / name, fetched.damaged):
            fetched.files.append(name)
    for path in (folder / SLICES).glob("*"):  # of another job, which was broken off
        if path.name not in slices:
            path.unlink()
    if slices:
        fetched.files.append(SLICES)
        (folder / SLICES).mkdir(exist_ok=True)
    for name, part in slices.items():
        path = folder / SLICES / name
        if name not in kept and not _is_one_of(slices, path):
            _download(client, job.id, f"slices/{part.index}.exr", path, fetched.damaged)
    if fetched.points:
        fetched.files.append("curve.csv")
        (folder / "curve.csv").write_text(curve_csv(fetched.points), encoding="utf-8")
    return fetched


def _summarise(job: JobView, fetched: _Fetched, folder: Path, shown: Path) -> dict[str, Any]:
    texts: dict[str, str] = {}
    if fetched.points:
        texts["curve.svg"] = job_svg(job, fetched.points, style=STYLE)
    texts["summary.txt"] = job_text.summary(job, utc_now()) + "\n"
    files = [str(shown / name) for name in (*fetched.files, *texts, "summary.json")]
    about = job_text.summary_json(job, fetched.points, files)
    texts["summary.json"] = json.dumps(about, indent=2) + "\n"
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return about


def _slices(client: Source, job: JobView) -> dict[str, SliceView]:
    """The slices that the job kept, by the names of their files."""
    if not job.spec.keep_slices:
        return {}
    return {f"{part.index:06d}.exr": part for part in client.slices(job.id)}


def _is_one_of(slices: dict[str, SliceView], path: Path) -> bool:
    """Whether the file is the slice of its name, byte for byte, and not the one of another job."""
    part = slices.get(path.name)
    return (
        part is not None
        and path.exists()
        and hashlib.sha256(path.read_bytes()).hexdigest() == part.sha256
    )


def _download(client: Source, job_id: str, name: str, path: Path, damaged: dict[str, str]) -> bool:
    """Fetch a file, if it is there; what is said of a damaged one is noted by its name."""
    try:
        client.download(job_id, name, path)
    except ApiError as error:
        if error.slug == "spoiled-file":
            damaged[name] = str(error)
        elif error.slug != "no-image-yet":
            raise
        return False
    return True
