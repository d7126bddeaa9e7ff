"""The data folder, copied as docs/durability.md says, is a Plateau with all that this one had."""

import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from plateau.client import Client
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.wire.views import JobView
from tests.support.farms.real_farm import BOX
from tests.support.processes.commands import Command, starting
from tests.support.until import until

READY = r"listens at (http://127\.0\.0\.1:\d+)"
RESULTS = ("image.exr", "image.png", "difference.png")

#: Checkpoints are five seconds apart: the long job has two before it ends.
SHORT, LONG = 80, 8000

Up = Callable[..., Command]


@pytest.fixture
def up(tmp_path: Path, cache: Path) -> Iterator[Up]:
    def start(data: Path, workers: int = 1) -> Command:
        arguments = ("up", "--workers", str(workers), "--port", "0")
        settings = {"PLATEAU_DATA": str(data), "PLATEAU_CACHE": str(cache), "PLATEAU_LEASE_S": "2"}
        return Command(*arguments, folder=tmp_path, **settings)

    yield from starting(start)


def test_a_copy_made_at_rest_has_everything(up: Up, tmp_path: Path) -> None:
    data, copy = tmp_path / "first", tmp_path / "second"
    # Given a service that has finished a job and was stopped
    first = up(data)
    with Client(first.wait_for(READY)) as client:
        job = client.wait(client.submit(BOX, _spec(SHORT)).id)
        images = _images(client, job)
    first.process.terminate()
    assert first.exit_code() == 0
    # If its folder is copied, and lost
    subprocess.run(["cp", "-a", data, copy], check=True)
    shutil.rmtree(data)
    # Then a service on the copy has the job, its results and its scene
    with Client(up(copy, 0).wait_for(READY)) as client:
        assert client.job(job.id) == job
        assert _images(client, job) == images
        assert client.submit(job.scene_sha256, _spec(SHORT)).state == "queued"


@pytest.mark.long
def test_a_copy_made_at_work_has_everything(up: Up, tmp_path: Path) -> None:
    data, copy = tmp_path / "first", tmp_path / "second"
    # Given a service that has finished a job, and has another under way
    first = up(data)
    with Client(first.wait_for(READY)) as client:
        done = client.wait(client.submit(BOX, _spec(SHORT)).id)
        images = _images(client, done)
        running = client.submit(BOX, _spec(LONG))
        until(lambda: bool(_checkpoints(data, running)), 120)
        # If its folder is copied meanwhile, Redis first
        copy.mkdir()
        _copy(data / "redis", copy)
        assert client.job(running.id).state is JobState.RENDERING
        # (And the blobs so late that what its Redis speaks of is gone)
        old = _checkpoints(data, running)
        until(lambda: not old & _checkpoints(data, running), 120)
        _copy(data / "blobs", copy)
        curve = client.curve(running.id)
    # And the service is killed, and its folder lost
    first.end()
    shutil.rmtree(data)
    # Then one on the copy has the results, byte for byte
    with Client(up(copy).wait_for(READY)) as client:
        assert client.job(done.id) == done
        assert _images(client, done) == images
        # And the other job goes on to its end, on the same curve
        ended = client.wait(running.id)
        assert (ended.state, ended.spp) == (JobState.CONVERGED, LONG)
        assert [one.index for one in client.slices(running.id)] == list(range(LONG // 20))
        points = {point.spp: point.visible_pixels for point in client.curve(running.id)}
        assert list(points) == list(range(40, LONG + 1, 40))
        assert points.items() >= {(point.spp, point.visible_pixels) for point in curve}


def _spec(max_spp: int) -> JobSpec:
    """A job of tiny images that ends at so many spp, not before."""
    return JobSpec.model_validate(
        {
            "parameters": {"width": 24, "height": 24},
            "variant": "scalar_rgb",
            "step": 40,
            "slice_spp": 20,
            "max_spp": max_spp,
            "rule": {"name": "fixed", "spp": max_spp},
        }
    )


def _checkpoints(data: Path, job: JobView) -> set[str]:
    return {path.name for path in data.glob(f"blobs/jobs/{job.id}/checkpoints/*")}


def _images(client: Client, job: JobView) -> dict[str, bytes]:
    return {name: client.image(job.id, name) for name in RESULTS}


def _copy(folder: Path, into: Path) -> None:
    """Copy a folder in use; what vanishes meanwhile is missed by ``cp``, and by nobody else."""
    copied = subprocess.run(["cp", "-a", folder, into], capture_output=True, text=True)
    missed = [line for line in copied.stderr.splitlines() if "No such file" not in line]
    assert missed == []
