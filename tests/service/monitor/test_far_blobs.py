"""A monitor far from the blob store asks it for several partials at a time, and merges in order."""

import threading
import time
from pathlib import Path

import redis

from plateau.farm.blobs.read_ahead import SLOW_S
from plateau.farm.blobs.store import Blobs
from plateau.farm.images.exr import decode_image
from plateau.farm.ledger.ownership import Ownerships
from plateau.farm.model.job import Job
from tests.support.farms.noise_farm import NoiseFarm

SLICES = 64


class FarStore(Blobs):
    """A store whose answers take time; it counts who waits for them."""

    def __init__(self, where: str) -> None:
        super().__init__(where)
        self.waiting = self.most_waiting = 0
        self._lock = threading.Lock()

    def get(self, name: str) -> bytes:
        with self._lock:
            self.waiting += 1
            self.most_waiting = max(self.most_waiting, self.waiting)
        time.sleep(3 * SLOW_S)
        with self._lock:
            self.waiting -= 1
        return super().get(name)


def submit_committed(farm: NoiseFarm, client: redis.Redis) -> Job:
    """A job of which all slices are committed before a monitor has seen one."""
    spp = 10 * SLICES
    rule = {"name": "fixed", "spp": spp}
    job = farm.submit(slice_spp=10, step=spp // 2, max_spp=spp, rule=rule)
    owners = Ownerships(client, lease_s=60)
    owned = owners.acquire(job.id)
    assert owned is not None
    owners.plan(owned, range(SLICES))
    owners.disown((owned,))
    farm.render(SLICES)
    return job


def test_partials_are_read_ahead_and_merged_in_order(
    client: redis.Redis, redis_url: str, tmp_path: Path
) -> None:
    farm = NoiseFarm(client, redis_url, tmp_path)
    far = FarStore(farm.settings.blobs or "")
    near_job = submit_committed(farm, client)
    with farm.monitor():
        farm.finish(near_job)
    # When the store is far, and one of the partials is lost and rendered again
    far_job = submit_committed(farm, client)
    (lost,) = (name for name in far.names(f"jobs/{far_job.id}/") if "000020" in name)
    far.delete(lost)
    farm.store = far
    with farm.monitor():
        farm.finish(far_job)
    # Then several were read at a time, and the image has the same bits
    assert far.most_waiting > 1
    one, other = (decode_image(farm.picture(job, "image.exr")) for job in (near_job, far_job))
    assert one.tobytes() == other.tobytes()
