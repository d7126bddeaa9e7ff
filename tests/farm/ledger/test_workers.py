"""Workers: draining them, and what each has saved."""

from pathlib import Path

import pytest
import redis

from plateau.farm.ledger.workers import Workers
from plateau.farm.model.errors import WorkerNotFound
from tests.support.farms.noise_farm import NoiseFarm


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, tmp_path: Path) -> NoiseFarm:
    return NoiseFarm(client, redis_url, tmp_path)


def about(name: str) -> dict[str, object]:
    return {
        "id": name,
        "host": "here",
        "pid": 1,
        "variants": ("scalar_rgb",),
        "threads": 1,
        "job": None,
        "slice": None,
        "slices_done": 0,
        "samples_per_s": None,
        "last_error": None,
        "started_at": "2026-11-21T08:00:00Z",
    }


def test_a_drained_worker_finishes_what_it_has_and_takes_no_more(
    farm: NoiseFarm, client: redis.Redis
) -> None:
    workers = Workers(client)
    farm.queue.heartbeat(about("noise"), ())
    farm.submit()
    with farm.monitor():
        farm.render(1)
        lease = farm.lease()
        assert lease is not None
        # When it is drained with a slice in hand
        workers.drain("noise")
        workers.drain("noise")  # repeating it is harmless
        # Then there is nothing for it, it says so, and what it has in hand counts
        assert farm.lease() is None
        assert [one.drained for one in Workers(farm.client).living()] == [True]
        assert farm.commit(lease) == "committed"
        # A heartbeat does not forget it
        farm.queue.heartbeat(about("noise"), ())
        assert farm.lease() is None
        # And it can work again
        workers.resume("noise")
        workers.resume("noise")
        assert [one.drained for one in Workers(farm.client).living()] == [False]
        farm.render(1)


@pytest.mark.parametrize("steer", [Workers.drain, Workers.resume])
def test_only_a_living_worker_can_be_told(client: redis.Redis, steer: object) -> None:
    with pytest.raises(WorkerNotFound, match="there is no worker 'nobody'"):
        steer(Workers(client), "nobody")  # type: ignore[operator]
