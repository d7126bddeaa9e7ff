"""The files that a job leaves with its user."""

import csv
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
import redis
from typer.testing import CliRunner

from plateau.client import Client
from plateau.commands import app
from plateau.errors import CommandFailed
from plateau.farm.blobs.store import Blobs
from plateau.farm.model.states import JobState
from plateau.rendering.outputs import write_results
from tests.support.farms.staged_job import StagedJob
from tests.support.long_tests import WANTED


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


def failed(client: redis.Redis) -> StagedJob:
    job = StagedJob(client)
    job.end(JobState.FAILED, "no plugin of that name")
    job.finish(0)
    return job


def visible(folder: Path) -> set[str]:
    """The names of what a person sees in the folder."""
    return {path.name for path in folder.iterdir() if not path.name.startswith(".")}


def test_all_that_a_converged_job_has(
    plateau: Client, client: redis.Redis, store: Blobs, tmp_path: Path
) -> None:
    job = finished(client, store)
    folder = tmp_path / "new" / "out"
    about = write_results(plateau, plateau.job(job.id), folder)
    assert visible(folder) == {
        "image.exr",
        "image.png",
        "difference.png",
        "curve.csv",
        "curve.svg",
        "summary.txt",
        "summary.json",
    }
    assert {Path(name).name for name in about["files"]} == visible(folder)
    assert (folder / "image.exr").read_bytes() == b"image.exr"
    rows = list(csv.DictReader((folder / "curve.csv").read_text().splitlines()))
    assert [row["spp"] for row in rows] == ["100", "200", "300", "400"]
    assert (folder / "curve.svg").read_text().startswith("<svg ")
    text = (folder / "summary.txt").read_text()
    assert "converged" in text
    assert re.search(r"^samples: +400 of at most 1,000 spp$", text, re.MULTILINE)
    assert f"60 % of the cap, {600 * 32 * 24:,} samples" in text
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["state"], summary["saved_fraction"]) == ("converged", 0.6)
    assert len(summary["curve"]) == 4


def test_a_file_that_is_damaged_costs_the_others_nothing(
    plateau: Client, client: redis.Redis, store: Blobs, tmp_path: Path
) -> None:
    # Given a job of which one file was damaged since it was written
    job = StagedJob(client, max_spp=1000)
    job.commit(16)
    job.point(100, 0)
    job.picture(store, "image.png", b"image.png")
    job.picture(store, "image.exr", b"image.exr", was=b"another")
    job.end()
    job.finish(400)
    # Then all others are written, and the command says which is missing and why
    with pytest.raises(CommandFailed, match=r"/image.exr is damaged or lost"):
        write_results(plateau, plateau.job(job.id), tmp_path / "out")
    written = {path.name for path in (tmp_path / "out").glob("[!.]*")}
    assert written == {*("image.png", "curve.csv", "curve.svg", "summary.txt", "summary.json")}


@pytest.mark.parametrize("state", [JobState.EXHAUSTED, JobState.CANCELLED])
def test_a_job_that_did_not_converge_saved_nothing(
    plateau: Client, client: redis.Redis, store: Blobs, tmp_path: Path, state: JobState
) -> None:
    job = finished(client, store, state)
    about = write_results(plateau, plateau.job(job.id), tmp_path)
    assert about["saved_fraction"] == 0
    assert "of the cap" not in (tmp_path / "summary.txt").read_text()


class TestAFolderThatAnotherJobHadBefore:
    def test_has_nothing_of_it_any_more(
        self, plateau: Client, client: redis.Redis, store: Blobs, tmp_path: Path
    ) -> None:
        # Given a folder with the results of a job, and files of somebody else
        write_results(plateau, plateau.job(finished(client, store).id), tmp_path)
        (tmp_path / "slices").mkdir()
        (tmp_path / "slices" / "000000.exr").write_bytes(b"a slice")
        others = {"notes.txt", "image-1.png", "slices/mine.exr"}
        for name in others:
            (tmp_path / name).write_text("mine")
        # When another that has no image leaves its results there
        write_results(plateau, plateau.job(failed(client).id), tmp_path)
        # Then nothing of the first is left, and all else is
        files = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
        assert files == {"summary.txt", "summary.json", ".plateau-job"} | others
        assert all((tmp_path / name).read_text() == "mine" for name in others)

    def test_has_the_files_of_one_job_whenever_its_writer_is_killed(
        self, api: str, plateau: Client, client: redis.Redis, store: Blobs, tmp_path: Path
    ) -> None:
        # Given the results of a job, and another with other images and without a curve
        write_results(plateau, plateau.job(finished(client, store).id), tmp_path / "before")
        after = StagedJob(client)
        after.commit(4)
        for name in ("image.exr", "image.png", "difference.png"):
            after.picture(store, name, f"another {name}".encode())
        after.end(JobState.CANCELLED, "enough")
        after.finish()
        write_results(plateau, plateau.job(after.id), tmp_path / "there")
        before, whole = content(tmp_path / "before"), content(tmp_path / "there")
        # When its writer is killed in the first one's folder, before changes that it makes there
        stride = 1 if WANTED else 3
        kills = [
            json.loads(line)
            for line in subprocess.run(
                [
                    sys.executable,
                    "-m",
                    "tests.support.faults.killed_writer",
                    api,
                    after.id,
                    str(tmp_path),
                    str(stride),
                ],
                check=True,
                stdout=subprocess.PIPE,
                text=True,
            ).stdout.splitlines()
        ]
        # Then what is to be seen is all of the one until all of the other is there; while files are
        # renamed it is some of either, and nothing is torn
        seen = [
            {name: text for name, text in kill["killed"].items() if name[0] != "."}
            for kill in kills
        ]
        between = [found for found in seen if found not in (before, whole)]
        files = len(before) + len(whole)
        assert stride * seen.count(before) > files > stride * (len(between) - 1)
        assert seen == [before] * seen.count(before) + between + [whole] * seen.count(whole)
        for kill, found in zip(kills, seen, strict=True):
            assert found.items() <= before.items() or found.items() <= whole.items(), found.keys()
            # And who writes it once more leaves nothing else there
            assert kill["again"].keys() == {*whole, ".plateau-job"}

    @pytest.mark.parametrize("command", [["fetch"], ["watch"]])
    def test_has_files_of_somebody_else_and_is_refused(
        self, api: str, client: redis.Redis, tmp_path: Path, command: list[str]
    ) -> None:
        (tmp_path / "image.png").write_text("a texture")
        done = CliRunner().invoke(
            app, [*command, failed(client).id, "-o", str(tmp_path), "--url", api]
        )
        assert done.exit_code == 1
        assert f"{tmp_path / 'image.png'} is there, and Plateau did not write it" in done.stderr
        assert [path.name for path in tmp_path.iterdir()] == ["image.png"]


def content(folder: Path) -> dict[str, str]:
    """What a person sees in the folder, as `tests.support.faults.killed_writer` says it."""
    return {name: (folder / name).read_bytes().hex() for name in visible(folder)}
