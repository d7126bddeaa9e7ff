"""The files that a job leaves with its user."""

import hashlib
import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol, TypeVar

from plateau.client import ApiError
from plateau.errors import CommandFailed
from plateau.farm.model.job import CurvePoint, Event, utc_now
from plateau.farm.wire import job_text
from plateau.farm.wire.report import CAPTIONS, curve_file, report_html
from plateau.farm.wire.views import JobView, SliceView
from plateau.files.job_folder import (
    IMAGES,
    NOISE_MAP,
    QUALITY_MAP,
    SLICES,
    SPP_MAP,
    begin,
    in_turn,
    whole,
)

_KEPT: Final = "plateau-kept-"

_Written = TypeVar("_Written")


class Source(Protocol):
    """What has the results of a job: a client of its service."""

    def curve(self, job_id: str, /) -> list[CurvePoint]:
        """The points of its curve."""

    def curve_csv(self, job_id: str, /) -> str:
        """The same as CSV."""

    def happened(self, job_id: str, /) -> list[Event]:
        """Its events."""

    def slices(self, job_id: str, /) -> list[SliceView]:
        """Its ledger."""

    def download(self, job_id: str, name: str, path: Path, /) -> None:
        """Write one of its files; raises `ApiError` ``no-image-yet`` if there is none."""


def write_results(client: Source, job: JobView, folder: Path) -> dict[str, Any]:
    """Write all that is known of an ended job into a folder; returns the summary as JSON.

    These are ``image.exr``, ``image.png``, ``difference.png`` and ``noise.png``, where the job has
    an image and its maps;
    ``spp.png``, where it is allocated by zones; ``non-finite.png``, where the image is NaN or
    infinite anywhere; ``curve.csv`` and ``curve.svg``, where its curve has points; ``slices``,
    where it kept them, for `plateau judge`; ``report.html``, ``summary.txt`` and ``summary.json``.
    Slices that are there already are not fetched again; what another job has left there is removed
    before the first file is written.

    Raises
    ------
    OSError
        They cannot be written; its `filename` is the folder's where it is no file's.
    CommandFailed
        All but some were written: those are damaged in the service's store.
    """
    try:
        with in_turn(folder):
            fetched = _fetch(client, job, folder)
            about = _summarise(job, fetched, folder)
        _check_whole(fetched)
        return about
    except OSError as error:
        if error.strerror and error.filename is None:  # a full disk says no name
            error.filename = str(folder)
        raise


def write_or_keep(
    client: Source, job: JobView, folder: Path, *, when_fetched: Callable[[], None]
) -> dict[str, Any]:
    """The same for a job that is gone with its service: what cannot be written is kept elsewhere.

    `when_fetched` is called where nothing more is asked of the service, and only drawing and
    writing is left.

    Raises
    ------
    CommandFailed
        The folder did not take it all; the message names the temporary folder that has the rest.
        Or some files are damaged in the service's store.
    """
    place = _Place(folder)
    with in_turn(folder):
        fetched = place.take(lambda there: _fetch(client, job, there))
        when_fetched()
        about = place.take(lambda there: _summarise(job, fetched, there))
    if place.trouble is not None:
        raise CommandFailed(
            f"not all could be written into {folder} ({place.trouble.strerror or place.trouble}): "
            f"the rest is in {place.folder}; move it to where you want it"
        )
    _check_whole(fetched)
    return about


class _Place:
    """A folder, until it cannot be written; from then on a fresh temporary one."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.trouble: OSError | None = None

    def take(self, write: Callable[[Path], _Written]) -> _Written:
        try:
            return write(self.folder)
        except OSError as error:
            if self.trouble is not None:
                raise
            self.folder, self.trouble = Path(tempfile.mkdtemp(prefix=_KEPT)), error
            return write(self.folder)


@dataclass(frozen=True)
class _Fetched:
    points: list[CurvePoint]
    events: list[Event]
    files: list[Path]
    damaged: dict[str, str]  #: what the service says of each file that it does not have whole


def _fetch(client: Source, job: JobView, folder: Path) -> _Fetched:
    folder.mkdir(parents=True, exist_ok=True)
    # Asked for before anything is removed: the service may be gone.
    slices = _slices(client, job)
    fetched = _Fetched(client.curve(job.id), client.happened(job.id), [], {})
    begin(folder, job.id, lambda path: _is_one_of(slices, path))
    for name in IMAGES:
        if name == SPP_MAP and not job.spec.by_zones:
            continue
        if name == QUALITY_MAP and not (job.spec.by_quality and "quality_png" in job.links):
            continue
        if name == NOISE_MAP and "noise_png" not in job.links:
            continue
        if _download(client, job.id, name, folder / name, fetched.damaged):
            fetched.files.append(folder / name)
    if job.spec.keep_slices:
        fetched.files.append(_write_slices(client, job, slices, folder / SLICES, fetched.damaged))
    if fetched.points:
        fetched.files.append(folder / "curve.csv")
        _write(folder / "curve.csv", client.curve_csv(job.id))
    return fetched


def _check_whole(fetched: _Fetched) -> None:
    if fetched.damaged:
        raise CommandFailed("\n".join(fetched.damaged.values()))


def _summarise(job: JobView, fetched: _Fetched, folder: Path) -> dict[str, Any]:
    files = list(fetched.files)
    if fetched.points:
        files.append(folder / "curve.svg")
        _write(folder / "curve.svg", curve_file(job, fetched.points))
    files += [folder / "report.html", folder / "summary.txt", folder / "summary.json"]
    pictures: dict[str, bytes | None] = {
        path.name: path.read_bytes() for path in fetched.files if path.name in CAPTIONS
    }
    pictures.update((name, None) for name in fetched.damaged if name in CAPTIONS)
    _write(folder / "report.html", report_html(job, fetched.points, fetched.events, pictures))
    _write(folder / "summary.txt", job_text.summary(job, utc_now()) + "\n")
    about = job_text.summary_json(job, fetched.points, [str(path) for path in files])
    _write(folder / "summary.json", json.dumps(about, indent=2) + "\n")
    return about


def _write(file: Path, text: str) -> None:
    with whole(file) as path:
        path.write_text(text)


def _slices(client: Source, job: JobView) -> dict[str, SliceView]:
    """The slices that the job kept, by the names of their files."""
    if not job.spec.keep_slices:
        return {}
    return {f"{part.index:06d}.exr": part for part in client.slices(job.id)}


def _write_slices(
    client: Source,
    job: JobView,
    slices: dict[str, SliceView],
    folder: Path,
    damaged: dict[str, str],
) -> Path:
    folder.mkdir(exist_ok=True)
    for name, part in slices.items():
        if not _is_one_of(slices, folder / name):
            _download(client, job.id, f"slices/{part.index}.exr", folder / name, damaged)
    return folder


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
