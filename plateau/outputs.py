"""The files that a job leaves with its user."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from farm.job import CurvePoint
from plateau import words
from plateau.client import ApiError, Client
from plateau.plot import plot_job
from service.views import JobView

_IMAGES: Final = ("image.exr", "image.png", "difference.png")


def write_results(
    client: Client, job: JobView, folder: Path, *, when_fetched: Callable[[], None] | None = None
) -> dict[str, Any]:
    """Write all that is known of an ended job into a folder; returns the summary as JSON.

    These are ``image.exr``, ``image.png`` and ``difference.png``, where the job has an image;
    ``curve.csv`` and ``curve.png``, where its curve has points; ``slices``, where it kept them, for
    `plateau judge`; ``summary.txt`` and ``summary.json``. `when_fetched` is called where nothing
    more is asked of the service, and only drawing and writing is left.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / name for name in _IMAGES if _download(client, job.id, name, folder / name)]
    if job.spec.keep_slices:
        files.append(_write_slices(client, job, folder / "slices"))
    points = client.curve(job.id)
    if points:
        files += [folder / "curve.csv", folder / "curve.png"]
        (folder / "curve.csv").write_text(client.curve_csv(job.id))
    if when_fetched is not None:
        when_fetched()
    if points:
        plot_job(job, points, folder / "curve.png")
    files += [folder / "summary.txt", folder / "summary.json"]
    (folder / "summary.txt").write_text(words.summary(job) + "\n")
    about = summary_json(job, points, files)
    (folder / "summary.json").write_text(json.dumps(about, indent=2) + "\n")
    return about


def _write_slices(client: Client, job: JobView, folder: Path) -> Path:
    folder.mkdir(exist_ok=True)
    for part in client.slices(job.id):
        name = f"{part.index:06d}.exr"
        client.download(job.id, f"slices/{part.index}.exr", folder / name)
    return folder


def summary_json(job: JobView, points: list[CurvePoint], files: list[Path]) -> dict[str, Any]:
    """The job, its curve, how much it saved and the files that were written, as JSON values."""
    return {
        **job.model_dump(mode="json"),
        "saved_fraction": words.saved_fraction(job),
        "wall_s": words.wall_s(job),
        "curve": [point.model_dump(mode="json") for point in points],
        "files": [str(path) for path in files],
    }


def _download(client: Client, job_id: str, name: str, path: Path) -> bool:
    try:
        client.download(job_id, name, path)
    except ApiError as error:
        if error.slug == "no-image-yet":
            return False
        raise
    return True
