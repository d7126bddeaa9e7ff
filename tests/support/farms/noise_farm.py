"""A farm without workers: real Redis, real blobs, real EXRs, slices of an analytic scene.

The monitor cannot tell: it sees partials in the ledger. Every slice is a pure function of its
index, and a single pass of the analytic renderer.
"""

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import numpy as np
import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.bundle.analytic import AnalyticScene
from plateau.farm.images.exr import Partial, Pixels, encode_partial
from plateau.farm.images.view_transform import ViewTransform
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.queue import Lease, SliceQueue
from plateau.farm.model.job import Job
from plateau.farm.model.seeds import SeedRange
from plateau.farm.model.slices.rounds import slice_zones
from plateau.farm.model.slices.zones import Zone
from plateau.farm.model.spec import JobSpec
from plateau.farm.process.settings import Settings
from plateau.farm.process.waits import Stop
from plateau.service.monitor.monitor import Monitor
from plateau.worker.renderers.analytic.picture import Picture
from tests.support import FRAMES
from tests.support.farms.ledger_farm import record_of
from tests.support.threads import working
from tests.support.until import until

SIZE = (24, 32)  # height, width


def noise_film(index: int, spp: int, sigma: float) -> Pixels:
    """A slice of a grey ramp with noise of standard deviation `sigma` per sample."""
    return ramp(sigma).film(spp, seed=index)


@cache
def ramp(
    sigma: float, aovs: tuple[str, ...] = (), *, alpha: bool = False, size: tuple[int, int] = SIZE
) -> Picture:
    """What a farm's slices show: with AOVs, and with alpha."""
    height, width = size
    return Picture(
        AnalyticScene(
            width=width, height=height, light="ramp", level=sigma, additive=True, alpha=alpha
        ),
        aovs,
    )


class NoiseFarm:
    """Everything of a farm but workers."""

    variant = "scalar_rgb"  #: with which its slices are leased
    size = SIZE
    kinds = ("analytic 1",)  #: of its workers, which take turns
    transform: ViewTransform | None = None  #: of its scene

    def __init__(
        self,
        client: redis.Redis,
        url: str,
        folder: Path,
        sigma: float = 1.0,
        *,
        alpha: bool = False,
    ) -> None:
        self.client, self.jobs = client, Jobs(client)
        self.store = Blobs(str(folder / "blobs"))
        self.settings = Settings(redis_url=url, blobs=str(folder / "blobs"), lease_s=60.0)
        self.queue = SliceQueue(client, "noise", 60)
        self.sigma = sigma
        self.alpha = alpha
        self.blind = False  #: whether its worker is older than AOVs

    def submit(self, name: str = "noise", **spec: object) -> Job:
        return self.jobs.create(
            JobSpec.model_validate(FRAMES | spec), name=name, scene_sha256="00"
        ).job

    def render(self, slices: int) -> None:
        """Render slices as a worker would, of whatever job is next, until there were so many."""
        for _ in range(slices):
            self.commit(self.next_lease())

    @contextmanager
    def monitor(self) -> Iterator[Monitor]:
        """A monitor in a thread; left to itself at the end, as if it had been stopped."""
        stop = Stop()
        monitor = Monitor(self.settings, self.store)
        with working(lambda: monitor.run(stop), stop.set):
            yield monitor

    def picture(self, job: Job, name: str) -> bytes:
        return self.store.get(f"{self.jobs.results(job.id)}/{name}")

    def next_lease(self) -> Lease:
        """The next slice of whatever job is next, once one is planned."""
        return until(self.lease, 200, lambda: "nothing more was planned")

    def work(self, condition: Callable[[], object]) -> None:
        """Commit slices as they are planned, until the condition holds."""

        def step() -> object:
            lease = self.lease()
            if lease is not None:
                self.commit(lease)
            return condition()

        until(step)

    def finish(self, job: Job) -> Job:
        """Work until the job is finished; returns it as it is then."""
        self.work(lambda: self.is_finished(job))
        return self.jobs.get(job.id)

    def is_finished(self, job: Job) -> bool:
        return self.jobs.get(job.id).finished_at is not None

    def lease(self) -> Lease | None:
        return self.queue.lease((self.variant,), None, in_turn=False)

    def glimpse(self, lease: Lease, spp: int, content: bytes | None = None) -> str:
        """Show the first pass of a slice, of so many spp; returns where it is."""
        name = blobs.glimpse(lease.job_id, "noise")
        film = self._shown(lease).film(spp, seed=lease.index)
        self.store.put(name, content or self._partial(lease, spp, film))
        assert self.queue.glimpse(lease, name)
        return name

    def film(self, lease: Lease) -> Pixels:
        """The film of a slice."""
        film = self._shown(lease).film(lease.spp, seed=lease.index)
        parts = [film[y : y + h, x : x + w] for x, y, w, h in self._zones(lease)]
        return np.concatenate([part.reshape(-1, 4) for part in parts]) if parts else film

    def _zones(self, lease: Lease) -> tuple[Zone, ...]:
        return slice_zones(lease.spec, lease.round, self.size[1], self.size[0], border=0)

    def _shown(self, lease: Lease) -> Picture:
        aovs = () if self.blind else lease.spec.slice_aovs(lease.index)
        return ramp(self.sigma, aovs, alpha=self.alpha)

    def commit(self, lease: Lease, film: Pixels | None = None) -> str:
        spp = lease.spp
        if film is None:
            film = self.film(lease)
        content = self._partial(lease, spp, film)
        name = blobs.partial(lease.job_id, lease.index, "noise")
        self.store.put(name, content)
        sha256, seeds = hashlib.sha256(content).hexdigest(), self._seeds(lease)
        record = record_of(
            lease, seeds, spp=spp, blob=name, sha256=sha256, worker="noise", render_s=0.01
        )
        answer = self.queue.commit(lease, record, width=self.size[1], height=self.size[0], notes=())
        if answer == "ended":  # as a worker does
            self.store.delete(name)
        return answer

    def _seeds(self, lease: Lease) -> SeedRange:
        schedule = lease.spec.seed_schedule(lease.variant, self.size[1], self.size[0])
        return schedule.seed_range(lease.index, lease.spp)

    def _partial(self, lease: Lease, spp: int, film: Pixels) -> bytes:
        first_seed, last_seed = self._seeds(lease)
        return encode_partial(
            Partial(
                job_id=lease.job_id,
                index=lease.index,
                first_seed=first_seed,
                last_seed=last_seed,
                spp=spp,
                variant=lease.variant,
                scene_sha256=lease.scene_sha256,
                pixels=film,
                channels=self._shown(lease).channels,
                zones=self._zones(lease),
                renderer=self.kinds[lease.index % len(self.kinds)],
                transform=None if lease.index else self.transform,
            )
        )
