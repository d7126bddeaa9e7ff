"""`plateau movie` on batches of a real service."""

import io
import json
from pathlib import Path

import av
import pytest
import redis
from PIL import Image

from plateau.client import Client
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from tests.support.farms.staged_job import StagedJob
from tests.support.images.movies import pictures
from tests.support.processes.commands import plateau as command


@pytest.fixture(autouse=True)
def _service(api: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLATEAU_URL", api)


class Shot:
    """A batch whose pictures are grey, and as bright as the test says."""

    def __init__(self, client: redis.Redis, store: Blobs) -> None:
        self._jobs, self._client, self._store = Jobs(client), client, store

    def submit(self, **parameters: str) -> StagedJob:
        spec = JobSpec(batch="shot", parameters=parameters)
        job = self._jobs.create(spec, name="box", scene_sha256="00").job
        return StagedJob(self._client, job.id)

    def render(self, job: StagedJob, grey: int, width: int = 64) -> None:
        job.commit(4)
        job.point(100, 5)
        file = io.BytesIO()
        Image.new("RGB", (width, 48), (grey, grey, grey)).save(file, "PNG")
        job.picture(self._store, "image.png", file.getvalue())
        job.end(JobState.CONVERGED)
        job.finish()


@pytest.fixture
def shot(client: redis.Redis, store: Blobs, plateau: Client) -> Shot:
    return Shot(client, store)


def greys(path: Path) -> list[int]:
    """How bright the pictures of a movie are, in tens."""
    with av.open(str(path)) as movie:
        return [round(picture.mean() / 10) for picture in pictures(movie, "gray")]


def test_a_movie_plays_the_frames_by_their_numbers(shot: Shot, tmp_path: Path) -> None:
    # Given frames that came in another order, of which one was rendered again
    for frame, grey in [("10", 180), ("9", 90), ("1", 30), ("9", 110)]:
        shot.render(shot.submit(frame=frame), grey)
    code, said, _ = command("movie", "shot", "-o", str(tmp_path / "shot.mp4"), "--fps", "12")
    assert (code, "3 frames, 0.25 s at 12 frames per second" in said) == (0, True)
    dark, middle, bright = greys(tmp_path / "shot.mp4")
    assert dark < middle < bright
    assert middle in range(10, 13)  # limited range: 110 is shown as 16 + 110 · 219 / 255


def test_a_frame_without_an_image_is_stood_in_for(shot: Shot, tmp_path: Path) -> None:
    missing = shot.submit(frame="2")
    for frame, grey in [("1", 40), ("3", 200)]:
        shot.render(shot.submit(frame=frame), grey)
    out = str(tmp_path / "shot.webm")
    code, said, told = command("movie", "shot", "-o", out, "--json")
    assert code == 0
    assert json.loads(said) == {
        "file": out,
        "frames": 3,
        "seconds": 0.125,
        "without_image": [missing.id],
        "unfinished": 1,
    }
    assert "box frame=2 has no image: the picture before stands in for it" in told
    assert "1 of 3 frames are not finished" in told
    first, second, third = greys(tmp_path / "shot.webm")
    assert first == second < third


def test_what_is_no_movie_is_refused(shot: Shot, tmp_path: Path) -> None:
    first = shot.submit(frame="1")
    for words, says in [
        (["shot", "-o", "shot.avi"], "let it end with .mp4, .mov, .webm"),
        (["shot", "-o", "shot.mp4", "--fps", "fast"], "--fps is a number such as 24"),
        (["shot", "-o", "shot.mp4", "--fps", "1/0"], "--fps is a number such as 24"),
        (["shut", "-o", "shot.mp4"], "there is no batch"),
        (["shot", "-o", str(tmp_path / "shot.mp4")], "no job of the batch has an image yet"),
    ]:
        code, _, told = command("movie", *words)
        assert (code, says in " ".join(told.split())) == (1, True), told
    shot.render(first, 100)
    shot.render(shot.submit(frame="2"), 100, width=32)
    code, _, told = command("movie", "shot", "-o", str(tmp_path / "shot.mp4"))
    assert (code, "picture 1 of the movie is 32×48, and those before are 64×48" in told) == (
        1,
        True,
    )
    assert not list(tmp_path.glob("*shot*"))
