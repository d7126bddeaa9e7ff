"""A long batch comes out frame by frame: the monitor looks first where something happened."""

import time
from pathlib import Path

import redis

from plateau.farm.ledger.batches import Batches
from plateau.farm.model.spec import BatchSpec
from plateau.farm.model.states import JobState
from tests.support.farms.noise_farm import NoiseFarm

FRAMES = 300


def test_its_first_frame_is_done_long_before_its_last_begins(
    client: redis.Redis, redis_url: str, tmp_path: Path
) -> None:
    farm, batches = NoiseFarm(client, redis_url, tmp_path), Batches(client)
    spec = BatchSpec(
        parameters=[{"frame": frame} for frame in range(FRAMES)],
        step=20,
        slice_spp=10,
        max_spp=100,
        rule={"name": "fixed", "spp": 100},
    )
    farm.jobs.create_all(spec.job_specs("walk"), name="noise", scene_sha256="00")
    deadline = time.monotonic() + 120
    with farm.monitor():
        while JobState.CONVERGED not in (states := batches.get("walk").states):
            assert time.monotonic() < deadline, states
            for _ in range(5):
                lease = farm.lease()
                if lease is not None:
                    farm.commit(lease)
    assert states[JobState.QUEUED] > FRAMES * 2 / 3, states
    [done, *_] = farm.jobs.search(batch="walk", state=JobState.CONVERGED)[0]
    assert done.spec.parameters["frame"] in range(20)
