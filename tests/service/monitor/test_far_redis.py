"""A monitor keeps its jobs where the answers of Redis take a good part of a lease."""

import time
from pathlib import Path

import pytest
import redis

from plateau.farm.redis import keys
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.faults.redis_proxy import RedisProxy
from tests.support.until import until

LEASE_S = 2.0
DELAY_S = 0.3  #: each way


@pytest.mark.long
def test_a_monitor_far_from_redis_renews_in_time(
    client: redis.Redis, redis_url: str, tmp_path: Path
) -> None:
    with RedisProxy(Path(redis_url.removeprefix("unix://"))) as proxy:
        proxy.delay_s = DELAY_S
        farm = NoiseFarm(client, proxy.url, tmp_path)
        farm.settings = farm.settings.model_copy(update={"lease_s": LEASE_S})
        job = farm.submit()
        with farm.monitor():
            owner = keys.job(job.id, "owner")
            until(lambda: client.exists(owner))
            until_s = time.monotonic() + 3 * LEASE_S
            while time.monotonic() < until_s:
                assert client.exists(owner), "its ownership has run out"
                time.sleep(0.02)
