"""Batches from Python and on the command line."""

import json
import threading
from pathlib import Path

import pytest
import redis
from rich.console import Console

from plateau.client import ApiError, Client, InvalidSpec
from plateau.errors import CommandFailed
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.files.frames import each
from plateau.terminal.batch_progress import batch_progress_on
from tests.support.farms.staged_job import StagedJob
from tests.support.processes.commands import plateau as command
from tests.support.scenes.bundles import PLY, mesh, scene
from tests.support.until import until


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    """A scene with a mesh for each frame."""
    folder = tmp_path / "walk"
    folder.mkdir()
    default = b'<default name="frame" value="0"/>'
    parts = scene(mesh("$frame.ply")).partition(b">")
    (folder / "scene.xml").write_bytes(b"".join((*parts[:2], default, parts[2])))
    for frame in range(3):
        (folder / f"{frame}.ply").write_bytes(PLY)
    return folder


def end(client: redis.Redis, store: Blobs, job_id: str, state: JobState) -> None:
    staged = StagedJob(client, job_id)
    staged.commit(4)
    staged.point(100, 5)
    staged.picture(store, "image.png", b"a picture")
    staged.end(state)
    staged.finish()


def test_the_client_submits_a_scene_once_for_many_jobs(plateau: Client, walk: Path) -> None:
    spec = JobSpec(batch="walk", max_spp=200, parameters={"light": 1})
    with pytest.raises(ApiError) as caught:  # the scene has no light
        plateau.submit_batch(walk, [{"frame": 0}], spec)
    assert caught.value.slug == "broken-scene"
    spec = JobSpec(batch="walk/1", max_spp=200, parameters={"frame": 2})
    batch = plateau.submit_batch(walk, [{"frame": 0}, {}, {"frame": 1}], spec)
    assert (batch.name, batch.jobs) == ("walk/1", 3)
    made = list(plateau.all_jobs(batch="walk/1"))[::-1]
    assert [job.id for job in made] == batch.job_ids
    assert [job.spec.parameters for job in made] == [{"frame": 0}, {"frame": 2}, {"frame": 1}]
    assert {job.name for job in made} == {"walk"}
    assert len(plateau.scenes()) == 1
    # Each draws samples of its own, unless it is asked for the same ones
    assert [job.spec.seed for job in made] == [0, 1, 2]
    # It can be submitted again by its hash, and repeated
    again = plateau.submit_batch(
        made[0].scene_sha256, [{"frame": 1}], JobSpec(batch="b"), idempotency_key="k"
    )
    same = plateau.submit_batch(
        made[0].scene_sha256, [{"frame": 1}], JobSpec(batch="b"), idempotency_key="k"
    )
    assert same.job_ids == again.job_ids
    assert [line.name for line in plateau.all_batches()] == ["b", "walk/1"]
    with pytest.raises(InvalidSpec):
        plateau.submit_batch(walk, [])


class TestLists:
    @pytest.mark.parametrize(
        ("text", "values"),
        [
            ("n=0..3", ["0", "1", "2", "3"]),
            ("n=2..-2..2", ["2", "0", "-2"]),
            ("n=5..5", ["5"]),
            ("n=1..8..3", ["1", "4", "7"]),
            ("n=1..8:3", ["1", "4", "7"]),
            ("n=red,blue", ["red", "blue"]),
            ("n=0.5,1..2", ["0.5", "1", "2"]),
            ("n=1..3,7", ["1", "2", "3", "7"]),
            ("n=008..010", ["008", "009", "010"]),
            ("n=2026-11-27", ["2026-11-27"]),
        ],
    )
    def test_of_one_parameter(self, text: str, values: list[str]) -> None:
        assert each([text]) == [{"n": value} for value in values]

    def test_of_several_are_every_combination(self) -> None:
        assert each(["a=1..2", "b=x,y"]) == [
            {"a": "1", "b": "x"},
            {"a": "1", "b": "y"},
            {"a": "2", "b": "x"},
            {"a": "2", "b": "y"},
        ]

    @pytest.mark.parametrize(
        ("definitions", "words"),
        [
            (["n"], "NAME=FIRST..LAST"),
            (["n="], "NAME=FIRST..LAST"),
            (["=1..2"], "NAME=FIRST..LAST"),
            (["n=1..2", "n=3..4"], "one parameter twice"),
            (["n=1..8:0"], r"a range as 0..99 or 0..99:2.* not '1..8:0'"),
            (["n=0..1.5"], "a range as"),
            (["n=1-10"], r"did you mean 1\.\.10\?"),
            (["n=4,1-10x3"], r"did you mean 1\.\.10:3\?"),
            (["n=1:10"], r"did you mean 1\.\.10\?"),
            (["n=1,2,1"], "jobs 1 and 3 would be the same: n=1"),
            (["n=1,,2"], "no value before or after"),
            (["n=0..1000"], "makes 1,001 jobs"),
            (["n=0..999999999"], "makes 1,000,000,000 jobs"),
            (["n=1..100", "m=1..11"], "makes 1,100 jobs"),
        ],
    )
    def test_that_cannot_be_made(self, definitions: list[str], words: str) -> None:
        with pytest.raises(CommandFailed, match=words):
            each(definitions)


@pytest.mark.usefixtures("_service")
class TestTheCommandLine:
    def test_submits_a_range_of_frames(self, walk: Path, plateau: Client) -> None:
        code, out, error = command("submit", str(walk), "--each", "frame=0..2", "--batch", "w")
        assert (code, out) == (0, "w\n"), error
        made = list(plateau.all_jobs(batch="w"))[::-1]
        assert [job.spec.parameters["frame"] for job in made] == ["0", "1", "2"]
        code, out, _ = command("list", "batches")
        assert (code, out.split("\t")[:3]) == (0, ["w", "3", "3 queued"])
        code, out, _ = command("show", "--batch", "w")
        assert code == 0
        assert "w, 3 jobs: 3 queued" in out
        assert json.loads(command("show", "--batch", "w", "--json")[1])["job_ids"] == [
            job.id for job in made
        ]

    def test_submits_a_shot_and_shows_it(self, walk: Path) -> None:
        submitted = ("submit", str(walk), "--each", "frame=0..2", "--batch", "w", "--shot")
        for text, words in (
            ("24:goal=9", "--shot: takes FPS or FPS:target=JOD"),
            ("fast", "--shot: must be a number"),
            ("24:target=11", "--target: "),
        ):
            code, _, error = command(*submitted, text)
            assert (code, words in " ".join(error.split())) == (2, True), error
        assert command(*submitted, "24:target=none")[0] == 0
        code, out, _ = command("show", "--batch", "w", "--frames")
        assert code == 0
        assert "3 frames at 24 per second, rendering: 0 of them wait" in out
        assert out.count("queued") == 3
        found = json.loads(command("show", "--batch", "w", "--frames", "--json")[1])
        assert (found["fps"], found["target"]) == (24, None)
        assert "3 frames at 24 per second" in command("show", "--batch", "w")[1]
        code, _, error = command("submit", str(walk), "--shot", "24")
        assert (code, "give `parameters` as a list" in error) == (1, True)

    def test_submits_frames_with_the_same_seeds(self, walk: Path, plateau: Client) -> None:
        asked = ("submit", str(walk), "--seed", "7", "--same-seeds")
        assert command(*asked, "--each", "frame=1,2", "--batch", "s")[0] == 0
        assert [job.spec.seed for job in plateau.all_jobs(batch="s")] == [7, 7]
        code, _, error = command(*asked)
        assert (code, "give --each" in error) == (2, True)

    def test_cancels_pauses_and_resumes_all_of_it(self, plateau: Client, walk: Path) -> None:
        batch = plateau.submit_batch(walk, [{"frame": 0}, {"frame": 1}], JobSpec(batch="w"))
        for what, state in (("pause", "queued"), ("resume", "queued"), ("cancel", "cancelled")):
            code, out, _ = command(what, "--batch", "w")
            assert (code, out) == (0, "".join(f"{job} {state}\n" for job in batch.job_ids))
        for arguments in (["cancel"], ["cancel", batch.job_ids[0], "--batch", "w"], ["watch"]):
            code, _, error = command(*arguments)
            assert (code, "the id of a job, or --batch NAME" in " ".join(error.split())) == (
                2,
                True,
            )
        code, _, error = command("pause", "--batch", "none")
        assert (code, "there is no batch 'none'" in error) == (1, True)

    def test_watches_till_the_end_and_fetches_what_is_finished(
        self, plateau: Client, client: redis.Redis, store: Blobs, walk: Path, tmp_path: Path
    ) -> None:
        batch = plateau.submit_batch(
            walk, [{"frame": 0}, {"frame": 1}], JobSpec(batch="w", max_spp=100)
        )
        end(client, store, batch.job_ids[0], JobState.CONVERGED)
        out = tmp_path / "frames"
        first = out / f"0000-{batch.job_ids[0]}"

        def end_the_other() -> None:
            until((first / "summary.json").exists)  # the first is fetched while others run
            end(client, store, batch.job_ids[1], JobState.EXHAUSTED)

        ending = threading.Thread(target=end_the_other)
        ending.start()
        code, printed, progress = command("watch", "--batch", "w", "-o", str(out))
        ending.join()
        assert code == 3
        assert progress.splitlines()[0].startswith("1 queued, 1 converged")
        assert "1 converged, 1 reached their limit" in printed
        assert sorted(folder.name for folder in out.iterdir()) == [
            f"000{place}-{job_id}" for place, job_id in enumerate(batch.job_ids)
        ]
        assert (first / "image.png").read_bytes() == b"a picture"
        # What is there is not fetched again
        (first / "image.png").write_bytes(b"mine")
        assert command("watch", "--batch", "w", "-o", str(out), "--json")[0] == 3
        assert (first / "image.png").read_bytes() == b"mine"

    def test_takes_the_name_of_an_image_for_no_folder(
        self, client: redis.Redis, store: Blobs, tmp_path: Path
    ) -> None:
        made = Jobs(client).create(JobSpec(batch="walk"), name="walk", scene_sha256="00")
        end(client, store, made.job.id, JobState.CONVERGED)
        for words in (["watch", "--batch", "walk"], ["watch", made.job.id], ["fetch", made.job.id]):
            code, _, error = command(*words, "-o", str(tmp_path / "walk.exr"))
            assert (code, "name a folder, such as walk" in error) == (1, True), error
        assert list(tmp_path.glob("walk*")) == []
        # Where somebody has such a folder, it will do
        (tmp_path / "walk.png").mkdir()
        assert command("fetch", made.job.id, "-o", str(tmp_path / "walk.png"))[0] == 0

    def test_puts_no_two_batches_and_no_other_job_into_one_folder(
        self, client: redis.Redis, store: Blobs, tmp_path: Path
    ) -> None:
        # Given a batch, whose frames were fetched, and another
        jobs = Jobs(client)
        for name in ("walk", "run"):
            made = jobs.create(*[JobSpec(batch=name)] * 2, name=name, scene_sha256="00")
            for job in jobs.search(batch=name)[0]:
                end(client, store, job.id, JobState.CONVERGED)
        frames, single = tmp_path / "frames", tmp_path / "single"
        assert command("watch", "--batch", "walk", "-o", str(frames))[0] == 0
        assert command("fetch", made.job.id, "-o", str(single))[0] == 0
        before = sorted(tmp_path.rglob("*"))
        # When anything else is to be written there, then it is refused, and all is as it was
        for words, says in [
            (["watch", "--batch", "run", "-o", str(frames)], "results that are not of this batch"),
            (["watch", "--batch", "run", "-o", str(single)], f"the results of job {made.job.id}"),
            (["watch", made.job.id, "-o", str(frames)], "the results of a batch (0000-"),
            (["fetch", made.job.id, "-o", str(frames)], "the results of a batch (0000-"),
        ]:
            code, _, error = command(*words)
            assert (code, says in error, "another folder with -o" in error) == (1, True, True)
        assert sorted(tmp_path.rglob("*")) == before
        # But the batch itself may be watched again, and the job be fetched again
        assert command("watch", "--batch", "walk", "-o", str(frames))[0] == 0
        assert command("fetch", made.job.id, "-o", str(single))[0] == 0

    @pytest.mark.parametrize(
        ("ends", "code"),
        [
            ([JobState.CONVERGED, JobState.CONVERGED], 0),
            ([JobState.CONVERGED, JobState.EXHAUSTED], 3),
            ([JobState.EXHAUSTED, JobState.CANCELLED], 4),
            ([JobState.CANCELLED, JobState.FAILED], 1),
        ],
    )
    def test_says_by_its_exit_code_how_it_ended(
        self, client: redis.Redis, store: Blobs, ends: list[JobState], code: int
    ) -> None:
        made = Jobs(client).create(*[JobSpec(batch="w")] * len(ends), name="w", scene_sha256="00")
        assert made.job.spec.batch == "w"
        for job, state in zip(Jobs(client).search(batch="w")[0][::-1], ends, strict=True):
            end(client, store, job.id, state)
        assert command("watch", "--batch", "w")[0] == code


def test_live_progress_shows_how_far_all_are(
    plateau: Client, client: redis.Redis, store: Blobs, walk: Path
) -> None:
    batch = plateau.submit_batch(walk, [{"frame": 0}, {"frame": 1}], JobSpec(batch="w"))
    end(client, store, batch.job_ids[0], JobState.CONVERGED)
    plateau.submit(walk, JobSpec(batch="w"))
    console = Console(force_terminal=True, width=100, record=True, _environ={"TERM": "xterm"})
    with batch_progress_on(console) as show:
        show(plateau.batch("w"))
    text = console.export_text()
    assert "w  2 queued, 1 converged\n" in text
    assert "1 of 3 jobs" in text
