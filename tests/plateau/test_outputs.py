"""The files that a job leaves with its user."""

import csv
import json
from pathlib import Path

import pytest
import redis
from PIL import Image

from farm.blobs import Blobs
from farm.states import JobState
from plateau.client import Client
from plateau.outputs import write_results
from tests.support.staged_job import StagedJob


def finished(client: redis.Redis, store: Blobs, state: JobState = JobState.CONVERGED) -> StagedJob:
    job = StagedJob(client, max_spp=1000)
    job.commit(16)
    for spp, visible, slope in ((100, 0, None), (200, 20, 0.2), (300, 25, 0.1), (400, 25, 0.01)):
        job.point(spp, visible, slope)
    for name in ("image.exr", "image.png", "difference.png"):
        job.picture(store, name, name.encode())
    job.end(state, "because")
    job.finish(400)
    return job


def test_all_that_a_converged_job_has(
    plateau: Client, client: redis.Redis, store: Blobs, tmp_path: Path
) -> None:
    job = finished(client, store)
    folder = tmp_path / "new" / "out"
    about = write_results(plateau, plateau.job(job.id), folder)
    assert {path.name for path in folder.iterdir()} == {
        "image.exr",
        "image.png",
        "difference.png",
        "curve.csv",
        "curve.png",
        "summary.txt",
        "summary.json",
    }
    assert {Path(name) for name in about["files"]} == set(folder.iterdir())
    assert (folder / "image.exr").read_bytes() == b"image.exr"
    rows = list(csv.DictReader((folder / "curve.csv").read_text().splitlines()))
    assert [row["spp"] for row in rows] == ["100", "200", "300", "400"]
    with Image.open(folder / "curve.png") as picture:
        assert picture.size == (1200, 900)
    text = (folder / "summary.txt").read_text()
    assert "converged" in text
    assert "400 of at most 1,000 spp (40 %)" in text
    assert f"60 % of the cap, {600 * 32 * 24:,} samples" in text
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["state"], summary["saved_fraction"]) == ("converged", 0.6)
    assert len(summary["curve"]) == 4


@pytest.mark.parametrize("state", [JobState.EXHAUSTED, JobState.CANCELLED])
def test_a_job_that_did_not_converge_saved_nothing(
    plateau: Client, client: redis.Redis, store: Blobs, tmp_path: Path, state: JobState
) -> None:
    job = finished(client, store, state)
    about = write_results(plateau, plateau.job(job.id), tmp_path)
    assert about["saved_fraction"] == 0
    assert "of the cap" not in (tmp_path / "summary.txt").read_text()


def test_a_job_without_an_image_leaves_its_summary(
    plateau: Client, client: redis.Redis, tmp_path: Path
) -> None:
    job = StagedJob(client)
    job.end(JobState.FAILED, "no plugin of that name")
    job.finish(0)
    write_results(plateau, plateau.job(job.id), tmp_path / "out")
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written == {"summary.txt", "summary.json"}
    assert "no plugin of that name" in (tmp_path / "out" / "summary.txt").read_text()
