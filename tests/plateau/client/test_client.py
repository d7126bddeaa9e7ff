"""The Python client against a live API."""

import threading
import time
from pathlib import Path
from typing import Any

import pytest
import redis

from plateau.client import ApiError, Client, jobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.service.api.process import listen
from tests.support.farms.live_api import live_api
from tests.support.farms.staged_job import StagedJob
from tests.support.scenes.bundles import PLY, mesh, scene
from tests.support.until import until


@pytest.fixture
def box(tmp_path: Path) -> Path:
    folder = tmp_path / "box"
    folder.mkdir()
    (folder / "scene.xml").write_bytes(scene(mesh("a.ply")))
    (folder / "a.ply").write_bytes(PLY)
    return folder


def test_a_submission_may_take_long(api: str, box: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    put = Blobs.put

    def put_slowly(*given: Any) -> None:
        time.sleep(1.0)
        put(*given)

    monkeypatch.setattr(Blobs, "put", put_slowly)
    with Client(api, timeout_s=0.5, patience_s=0.0) as impatient:
        job = impatient.submit(box)
    with Client(api, patience_s=120) as client:
        assert list(client.all_jobs()) == [job]


def test_a_scene_goes_in_and_its_job_comes_out(
    plateau: Client,
    box: Path,
    client: redis.Redis,
    store: Blobs,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # A folder is packed with its meshes, and named after itself
    job = plateau.submit(box, JobSpec(max_spp=200, batch="b"))
    assert (job.state, job.name, job.spec.max_spp) == (JobState.QUEUED, "box", 200)
    assert plateau.job(job.id) == job
    assert plateau.scenes()[0].sha256 == job.scene_sha256
    # It can be submitted again by its hash
    again = plateau.submit(job.scene_sha256)
    assert [one.id for one in plateau.all_jobs()] == [again.id, job.id]
    assert [one.id for one in plateau.all_jobs(batch="b")] == [job.id]
    assert list(plateau.all_jobs(state=JobState.FAILED)) == []
    assert [one.id for one in plateau.all_jobs(limit=1)] == [again.id]
    monkeypatch.setattr(jobs, "_LARGEST_PAGE", 1)
    assert [one.id for one in plateau.all_jobs()] == [again.id, job.id]
    # When it is worked on (the other one is out of the way)
    plateau.cancel(again.id)
    staged = StagedJob(client, job.id)
    staged.commit(4)
    staged.point(100, 7, slope=0.1)
    staged.picture(store, "image.png", b"a picture")
    # Then all of that can be read
    assert [point.visible_pixels for point in plateau.curve(job.id)] == [7]
    assert plateau.curve_csv(job.id).startswith("spp,")
    assert [one.index for one in plateau.slices(job.id)] == [0, 1, 2, 3]
    assert plateau.workers() == []
    assert plateau.image(job.id) == b"a picture"
    plateau.download(job.id, "image.png", tmp_path / "image.png")
    assert (tmp_path / "image.png").read_bytes() == b"a picture"
    assert [event.type for event in plateau.happened(job.id)][-2:] == ["point", "image"]


def test_a_problem_is_an_error_with_all_that_it_says(
    plateau: Client, client: redis.Redis, tmp_path: Path
) -> None:
    with pytest.raises(ApiError, match="there is no job 'nope'") as caught:
        plateau.job("nope")
    assert (caught.value.status, caught.value.slug) == (404, "unknown-job")
    job = StagedJob(client)
    with pytest.raises(ApiError) as caught:
        plateau.download(job.id, "image.exr", tmp_path / "image.exr")
    assert caught.value.slug == "no-image-yet"
    assert list(tmp_path.glob("*image.exr*")) == []
    job.commit()
    job.end()
    with pytest.raises(ApiError) as caught:
        plateau.cancel(job.id)
    assert caught.value.problem["state"] == "converged"
    with pytest.raises(ApiError):
        list(plateau.events("nope"))


def test_events_go_on_after_the_api_was_restarted(
    redis_url: str, client: redis.Redis, store: Blobs
) -> None:
    # Given somebody who watches a job
    job = StagedJob(client)
    heard: list[str] = []
    with listen("127.0.0.1", 0) as free:
        port = free.getsockname()[1]
    plateau = Client(f"http://127.0.0.1:{port}", patience_s=120)
    watcher = threading.Thread(
        target=lambda: heard.extend(event.type for event in plateau.events(job.id))
    )
    with live_api(redis_url, store, port=port):
        watcher.start()
        job.commit()
        until(lambda: heard)
    # If the API goes and comes back while more happens
    job.point(25, 3)
    with live_api(redis_url, store, port=port):
        job.end()
        job.finish()
        watcher.join(120)
    # Then everything was heard once
    assert heard == ["state", "state", "slice", "point", "state", "image", "finished"]
    plateau.close()
