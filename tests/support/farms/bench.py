"""A worker in a thread of its own, and the job that it renders."""

import hashlib
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import psutil
import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Ownership, Ownerships
from plateau.farm.ledger.schema import check_schema
from plateau.farm.model.job import Job
from plateau.farm.model.spec import JobSpec
from plateau.farm.process.settings import Settings
from plateau.farm.process.waits import Stop
from plateau.worker.supervisor.supervisor import Supervisor
from plateau.worker.supervisor.variants import VariantChoice
from tests.support import FRAMES
from tests.support.farms.ledger_farm import own
from tests.support.processes.relatives import children_running
from tests.support.variants import known_probe


@cache
def scalar() -> VariantChoice:
    """What a worker finds out at its start, without what it renders faster with."""
    tried = (known_probe("scalar_rgb", None),)
    return VariantChoice("scalar_rgb", None, "asked for by the test", tried)


SCENE = """<scene version="3.0.0">
  <default name="size" value="16"/>
  <integrator type="{integrator}"/>
  <sensor type="perspective">
    <film type="hdrfilm">
      <integer name="width" value="$size"/><integer name="height" value="$size"/>
      <rfilter type="box"/>
    </film>
    <sampler type="multijitter"/>
  </sensor>
  <shape type="sphere"><transform name="to_world"><translate z="4"/></transform>
    <bsdf type="diffuse"/></shape>
  <emitter type="constant"/>
</scene>"""


class Bench:
    """A job's surroundings: a monitor's part played through the farm's own interface."""

    def __init__(self, client: redis.Redis, url: str, store: Blobs, folder: Path) -> None:
        check_schema(client)  # as every process does first
        self.client, self.store = client, store
        self.jobs, self.owners = Jobs(client), Ownerships(client, 60)
        self.settings = Settings(redis_url=url, cache=folder / "cache", threads=2, lease_s=5.0)

    def job(self, slices: int, scene: str | bytes = "", **spec: object) -> tuple[Job, Ownership]:
        content = scene or SCENE.format(integrator="path")
        content = content.encode() if isinstance(content, str) else content
        sha256 = hashlib.sha256(content).hexdigest()
        if not self.store.exists(blobs.scene(sha256)):  # each put waits for the disk
            self.store.put(blobs.scene(sha256), content)
        job = self.jobs.create(
            JobSpec.model_validate({**FRAMES, "slice_spp": 5, "step": 10, **spec}),
            name="ball",
            scene_sha256=sha256,
        ).job
        owned = own(self.owners, job.id)
        self.owners.plan(owned, range(slices))
        return job, owned

    @contextmanager
    def worker(self, choice: VariantChoice | None = None) -> Iterator[Supervisor]:
        stop = Stop()
        worker = Supervisor(self.settings, choice or scalar(), self.store, stop)
        thread = threading.Thread(target=worker.run)
        thread.start()
        try:
            yield worker
        finally:
            stop.set()
            thread.join(60)
            assert not thread.is_alive()


def render_children() -> list[psutil.Process]:
    return children_running("plateau.worker.child")


def the_child() -> psutil.Process:
    (child,) = render_children()
    return child
