"""A short animation: one list, one batch, fetched as they come."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from plateau.farm.images.exr import decode_image
from plateau.farm.model.spec import JobSpec
from tests.support.farms.real_farm import BOX, RealFarm
from tests.support.until import until

#: Small and quick: each frame converges after a few hundred spp.
SPEC = JobSpec.model_validate(
    {
        "batch": "walk/shot 1",
        "parameters": {"width": 24, "height": 24},
        "step": 20,
        "slice_spp": 20,
        "max_spp": 2000,
        "min_spp": 100,
        "rule": {"name": "reverse", "window": 2, "epsilon": 500.0},
    }
)


def test_three_frames_come_to_their_end_alike(farm: RealFarm, tmp_path: Path) -> None:
    # Given a farm, and three frames whose light differs
    farm.start("monitor")
    farm.workers(2)
    batch = farm.client.submit_batch(BOX, [{"intensity": light} for light in (10, 20, 40)], SPEC)
    assert batch.states == {"queued": 3}
    # When somebody watches them on the command line
    watching = subprocess.run(
        [
            *(sys.executable, "-m", "plateau", "watch", "--batch", batch.name),
            *("--out", str(tmp_path / "frames"), "--url", farm.client.url, "--json"),
        ],
        env=farm.environment,
        check=False,
        capture_output=True,
        text=True,
        timeout=300,
    )
    # Then that ends well, with all results
    assert watching.returncode == 0, watching.stderr
    found = json.loads(watching.stdout)
    assert (found["states"], found["finished"]) == ({"converged": 3}, 3)
    assert found["ended_at"] is not None
    # None of the frames ended too early, whatever its rule said
    assert found["spp"]["least"] >= 100
    jobs = [farm.client.job(job_id) for job_id in batch.job_ids]
    stopped = [
        [point.spp for point in farm.client.curve(job.id) if point.rules["reverse"].stop]
        for job in jobs
    ]
    for job, spps in zip(jobs, stopped, strict=True):
        assert job.spp == min(spp for spp in spps if spp >= 100)
    early = [job for job, spps in zip(jobs, stopped, strict=True) if spps[0] < 100]
    assert early, "no frame would have stopped before its least spp: the test shows nothing"
    assert all("min_spp is 100, so it could not end earlier" in job.reason for job in early)
    # Each folder has the image of its frame, in their order: each brighter than the one before
    folders = sorted((tmp_path / "frames").iterdir())
    assert [folder.name for folder in folders] == [
        f"{place:04d}-{job.id}" for place, job in enumerate(jobs)
    ]
    means = [
        float(np.mean(decode_image((folder / "image.exr").read_bytes()))) for folder in folders
    ]
    assert means == sorted(means)
    assert means[2] > 1.5 * means[0]


@pytest.mark.long
def test_a_paused_batch_gives_its_workers_to_others(farm: RealFarm) -> None:
    farm.start("monitor")
    farm.workers(1)
    endless = SPEC.model_copy(
        update={"batch": "endless", "max_spp": 1_000_000, "min_spp": 1_000_000}
    )
    batch = farm.client.submit_batch(BOX, [{"intensity": light} for light in (10, 20)], endless)
    until(lambda: farm.client.batch(batch.name).states.get("rendering"))
    # If it is paused, what has begun stands still, what has not is held back
    steered = farm.client.pause_batch(batch.name)
    assert steered.done == 2
    other = farm.submit(
        parameters={"width": 16, "height": 16},
        slice_spp=1,
        step=1,
        max_spp=4,
        priority=-1000,
        rule={"name": "fixed", "spp": 4},
    )
    assert farm.client.wait(other.id, timeout_s=120).state == "converged"
    until(lambda: all(worker.job is None for worker in farm.client.workers()))
    # And if it is cancelled, all of it ends
    farm.client.resume_batch(batch.name)
    farm.client.cancel_batch(batch.name)
    assert farm.client.wait_for_batch(batch.name, timeout_s=120).states == {"cancelled": 2}
