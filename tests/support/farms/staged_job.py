"""A job that a test moves along by hand, as a worker and a monitor would."""

import hashlib

import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Ownerships
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import EndedBy, JobState
from tests.support import FRAMES
from tests.support.farms.ledger_farm import lease_scalar, own, record_of

WIDTH, HEIGHT = 32, 24
WORKER = "worker-1"
#: What a slice is where nobody looks into it.
PARTIAL = b"a slice"


class StagedJob:
    """A job with its worker and its monitor, all played by the test."""

    def __init__(self, client: redis.Redis, job_id: str = "", **spec: object) -> None:
        jobs, self._client = Jobs(client), client
        if not job_id:
            created = jobs.create(
                JobSpec(**FRAMES | spec), name=str(spec.get("name", "box")), scene_sha256="0" * 64
            )
            job_id = created.job.id
        self.id = job_id
        self.spec = jobs.get(job_id).spec
        self._owners = Ownerships(client, lease_s=60)
        self._owned = own(self._owners, self.id)
        self._digests: dict[str, str] = {}  # of its pictures
        self._queue = SliceQueue(client, WORKER, lease_s=60)
        self._planned = 0
        self._put_back = 0  # slices that were planned, and wait since somebody died on them

    def plan(self) -> None:
        """Plan one more slice."""
        self._owners.plan(self._owned, range(self._planned, self._planned + 1))
        self._planned += 1

    def die(self, cause: str, said: str = "") -> None:
        """Plan and lease one more slice, and die on it; it is the next that is committed."""
        self.plan()
        self._put_back += 1
        self._queue.died(lease_scalar(self._queue), cause, 0.2, said)

    def commit(
        self, slices: int = 1, said: str = "", partial: bytes = PARTIAL, worker: str = WORKER
    ) -> None:
        """Plan, lease and commit so many slices; a test that looks into them puts `slice_blob`."""
        for _ in range(slices):
            if self._put_back:
                self._put_back -= 1
            else:
                self.plan()
            queue = self._queue if worker == WORKER else SliceQueue(self._client, worker, 60)
            lease = lease_scalar(queue)
            schedule = lease.spec.seed_schedule(lease.variant, WIDTH, HEIGHT)
            record = record_of(
                lease,
                schedule.seed_range(lease.index),
                blob=self.slice_blob(lease.index),
                sha256=hashlib.sha256(partial).hexdigest(),
                worker=worker,
                render_s=0.5,
            )
            answer = queue.commit(lease, record, width=WIDTH, height=HEIGHT, notes=(), said=said)
            assert answer == "committed"

    def slice_blob(self, index: int) -> str:
        """Where a slice is, as the ledger says."""
        return blobs.partial(self.id, index, "staged")

    def point(self, spp: int, visible: int, slope: float | None = None, **more: object) -> None:
        """Append a point to the curve, with more of its fields where they are given."""
        point = {
            "spp": spp,
            "visible_pixels": visible,
            "visible_fraction": visible / (WIDTH * HEIGHT),
            "slope": slope,
            "estimate_pixels": 100.5 / spp,
            "estimate_fraction": 0.1 / spp,
            "non_finite_pixels": 0,
            "rules": {"reverse": {"value": slope, "stop": False}},
            **more,
        }
        self._owners.append_point(self._owned, spp, point)

    def end(
        self,
        state: JobState = JobState.CONVERGED,
        reason: str = "levelled off",
        ended_by: EndedBy | None = None,
    ) -> None:
        """End the job, by what most often ends one so."""
        usual: dict[JobState, EndedBy] = {JobState.CONVERGED: "rule", JobState.EXHAUSTED: "cap"}
        by = ended_by or usual.get(state, "farm")
        self._owners.end(self._owned, state, by, reason, {"slope": 0.01})

    def finish(self, spp: int = 100) -> None:
        """Say that its results are written."""
        self._owners.conclude(self._owned, spp=spp, results=self.pictures, notes=())
        self._owners.finish(self._owned, keeps_sums=False)

    def picture(self, store: Blobs, name: str, content: bytes, was: bytes | None = None) -> None:
        """Put a picture where the API finds it, and note the SHA-256 of what it was."""
        store.put(f"{self.pictures}/{name}", content)
        self._digests[name] = hashlib.sha256(content if was is None else was).hexdigest()
        self._owners.show_results(self._owned, self.pictures, 100, self._digests)

    def preview(self, store: Blobs, spp: int, content: bytes) -> str:
        """Put the picture of a point; returns its blob."""
        blob = blobs.preview(self.id, spp)
        store.put(blob, content)
        self._owners.note_blob(self._owned, blob, hashlib.sha256(content).hexdigest())
        return blob

    @property
    def pictures(self) -> str:
        """Where its pictures are."""
        return blobs.result_set(self.id, 100, "staged")
