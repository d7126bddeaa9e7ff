"""The files that a job has left, or has come to so far."""

import json
from collections.abc import Iterable, Iterator
from itertools import chain
from typing import Final

from plateau.farm.blobs import names as blobs
from plateau.farm.model.job import Job, utc_now
from plateau.farm.wire import job_text
from plateau.farm.wire.csv_text import curve_csv
from plateau.farm.wire.curve_svg import STYLE, job_svg
from plateau.farm.wire.views import job_view
from plateau.picture import previews
from plateau.service.api.parts import Parts
from plateau.service.api.results.zip_stream import ZipEntry
from plateau.service.api.stored_files import SpoiledBlob

_EXR: Final = "image.exr"
_PICTURES: Final = (
    *("image.png", "difference.png", "noise.png", "quality.png", "spp.png", "non-finite.png"),
)


class JobFiles:
    """The files of a job, those of an image all of the same set of results.

    Parameters
    ----------
    farm
        Where the job is.
    job
        The job.
    folder
        What the names begin with: "" or the name of a folder and a slash.
    """

    def __init__(self, farm: Parts, job: Job, folder: str = "") -> None:
        self._farm = farm
        self._job = job
        self._folder = folder
        self._names: list[str] = []
        self._damaged: list[str] = []

    def entries(self) -> Iterator[ZipEntry]:
        """The files, each read when it is asked for.

        Of damaged ones, ``damaged.txt`` says which they are.
        """
        job = self._job
        pictures, exr = self._newest_image()
        if exr is not None:
            yield exr
        for name, content in pictures.items():
            if content is None:
                self._damaged.append(f"{name} is damaged in the farm's store")
            else:
                yield self._entry(name, content)
        for spp in previews.kept(self._farm.blobs, job.id):
            preview = self._stored(blobs.preview(job.id, spp), f"previews/{spp:06d}.png")
            if preview is not None:
                yield preview
        points = self._farm.jobs.curve(job.id)
        if points:
            yield self._entry("curve.csv", curve_csv(points))
            yield self._entry("curve.svg", job_svg(job, points, style=STYLE))
        view = job_view(job)
        yield self._entry("summary.txt", job_text.summary(view, utc_now()) + "\n")
        about = job_text.summary_json(view, points, [*self._names, "summary.json"])
        yield self._entry("summary.json", json.dumps(about, indent=2) + "\n")
        if self._damaged:
            yield self._entry("damaged.txt", "\n".join(self._damaged) + "\n")

    def _newest_image(self) -> tuple[dict[str, bytes | None], ZipEntry | None]:
        """The pictures and the EXR of one set, the newest when the last of them was read."""
        results = ""
        pictures: dict[str, bytes | None] = {}
        exr = None
        # A set is deleted when the next one is shown.
        while (shown := self._farm.jobs.results(self._job.id)) != results:
            results, self._names, self._damaged = shown, [], []
            pictures = self._pictures(shown)
            exr = self._stored(f"{shown}/{_EXR}", _EXR)
        return pictures, exr

    def _pictures(self, results: str) -> dict[str, bytes | None]:
        """The pictures of a set of results by name; None stands for a damaged one."""
        pictures: dict[str, bytes | None] = {}
        for name in _PICTURES:
            blob = f"{results}/{name}"
            try:
                pictures[name] = self._farm.files.content(blob, self._farm.jobs.sha256(blob))
            except SpoiledBlob:
                pictures[name] = None
            except FileNotFoundError:  # a newer set has just been shown, or this one has no map yet
                continue
        return pictures

    def _stored(self, blob: str, name: str) -> ZipEntry | None:
        """The blob, if it is there and whole."""
        sha256 = self._farm.jobs.sha256(blob)
        try:
            self._farm.files.require(blob, sha256)
            size = self._farm.blobs.size(blob) or 0
            chunks = self._farm.blobs.chunks(blob)
            begun = chain([next(chunks, b"")], chunks)  # once it is open, it may be deleted
        except SpoiledBlob as error:
            self._damaged.append(f"{name}: {error}")
            return None
        except FileNotFoundError:
            return None
        return self._entry(name, begun, size)

    def _entry(self, name: str, content: str | bytes | Iterable[bytes], size: int = 0) -> ZipEntry:
        self._names.append(name)
        if isinstance(content, str):
            content = content.encode()
        if isinstance(content, bytes):
            content, size = [content], len(content)
        at = self._job.ended_at or utc_now()
        return ZipEntry(f"{self._folder}{name}", content, size, at)
