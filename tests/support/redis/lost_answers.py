"""Every write to Redis as a case: how it is prepared, and what is answered when it is repeated."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.ledger.api_keys import ApiKey, ApiKeys, KeyLimits, Role
from plateau.farm.ledger.batches import Batches, Steer
from plateau.farm.ledger.continuation import Continuations
from plateau.farm.ledger.deletions import Deletions
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.outbox import Outbox
from plateau.farm.ledger.ownership import Checkpoint, Ownership, Ownerships
from plateau.farm.ledger.queue import Lease, SliceQueue, SliceRecord
from plateau.farm.ledger.scene_index import SceneIndex
from plateau.farm.ledger.shots import Shots
from plateau.farm.ledger.totals import note_sweep
from plateau.farm.ledger.workers import MonitorLife, Workers
from plateau.farm.model.errors import FenceLost
from plateau.farm.model.job import utc_now
from plateau.farm.model.shot import FrameAnswer, FrameWait, ShotLook
from plateau.farm.model.spec import BatchSpec, JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.redis.commands.members import Pair
from plateau.farm.redis.commands.notices import NoteTold, NoteTroubles
from plateau.farm.redis.commands.scenes import ForgetScene, NoteScenes, SceneGone
from plateau.farm.redis.commands.sweeps import DropSums, Forget
from plateau.farm.redis.scripts import Scripts
from plateau.farm.sweep import is_due
from tests.support.farms.receiver import SECRET

WORKER, OTHER = "worker-1", "worker-2"
LEASE_S = 60.0
NOTICE: Final[dict[str, Any]] = {"url": "https://lab.example/hook", "secret": SECRET}
SPEC: Final[dict[str, Any]] = {"step": 100, "slice_spp": 50, "max_spp": 1000}
RESULTS: Final = "jobs/0123456789ab/results/0000050-1-final"
SHA256: Final = {"image.png": "ab" * 32, "image.exr": "cd" * 32}
ABOUT: Final[dict[str, Any]] = {"id": WORKER, "variants": ["scalar_rgb"]}
LOOK: Final = ShotLook(
    at=utc_now(),
    spp=(50, 50),
    jod=9.0,
    low_jod=8.9,
    frames=(9.0, 9.0),
    low_frames=(8.9, 8.9),
    worst_frame=0,
    asked=(0,),
    seconds=1.0,
)


class World:
    """Redis twice: `direct`, by which cases are prepared, and `lossy`, by which they are done."""

    def __init__(self, direct: redis.Redis, lossy: redis.Redis) -> None:
        self.direct, self.lossy = direct, lossy
        self.jobs, self.outbox = Jobs(lossy), Outbox(lossy)
        self.workers, self.keys = Workers(lossy), ApiKeys(lossy)
        self.owners = Ownerships(lossy, LEASE_S)
        self.queue = SliceQueue(lossy, WORKER, LEASE_S)

    def load_scripts(self) -> None:
        """Have Redis know all scripts, so that a call of one is one command."""
        Scripts(self.direct).load()

    def job(self, *, slices: int = 2, owned: bool = True, **spec: Any) -> str:
        """A new job with so many slices planned."""
        wanted = JobSpec(**{**SPEC, **spec})
        made = Jobs(self.direct).create(wanted, name="box.xml", scene_sha256="0" * 64)
        if owned:
            owners = Ownerships(self.direct, LEASE_S)
            found = owners.acquire(made.job.id)
            assert found is not None
            self.owned: Ownership = found
            owners.plan(found, range(slices))
        return made.job.id

    def leased(self, **spec: Any) -> Lease:
        """A slice that the worker has leased."""
        self.job(**spec)
        lease = SliceQueue(self.direct, WORKER, LEASE_S).lease(("scalar_rgb",), None, in_turn=False)
        assert lease is not None
        return lease

    def committed(self, **spec: Any) -> Lease:
        """A slice that was committed by the worker."""
        lease = self.leased(**spec)
        assert commit(SliceQueue(self.direct, WORKER, LEASE_S), lease) == "committed"
        return lease

    def finished(self, **spec: Any) -> str:
        """A job that converged with one slice, and is done with."""
        job = self.committed(**spec).job_id
        owners = Ownerships(self.direct, LEASE_S)
        owners.save_checkpoint(self.owned, CHECKPOINT)
        owners.end(self.owned, JobState.CONVERGED, "rule", "levelled off", {"slope": 0.0}, RESULTS)
        owners.finish(self.owned, keeps_sums=True)
        return job

    def lease(self, lease_s: float) -> Lease | None:
        return SliceQueue(self.lossy, WORKER, lease_s).lease(("scalar_rgb",), None, in_turn=False)

    def heartbeat(self) -> None:
        SliceQueue(self.direct, WORKER, LEASE_S).heartbeat(ABOUT, ())

    def acquire(self, job: str, lease_s: float) -> Ownership | None:
        return Ownerships(self.lossy, lease_s).acquire(job)

    def api_key(self) -> ApiKey:
        return ApiKeys(self.direct).create("a key", Role.SUBMITTER, KeyLimits())[0]


CHECKPOINT = Checkpoint(blob="sums", sha256="ab" * 32, slices=1)


def commit(
    queue: SliceQueue, lease: Lease, blob: str = "a partial", seeds: tuple[int, int] | None = None
) -> str:
    first, last = seeds or (lease.index * 10, lease.index * 10 + 9)
    record = SliceRecord(
        index=lease.index,
        spp=lease.spec.slice_spp,
        first_seed=first,
        last_seed=last,
        blob=blob,
        sha256="ab" * 32,
        worker=WORKER,
        render_s=0.5,
    )
    return queue.commit(lease, record, width=32, height=24, notes=(), said="words")


@dataclass(frozen=True)
class Case:
    """A write."""

    prepare: Callable[[World], Callable[[], object]]  #: returns the write itself
    is_answered: Callable[[object], bool]  #: whether this is what the one who repeats it should get
    answers_before: int = 0  #: to what it reads first
    writes_only_times: bool = False


CASES: dict[str, Case] = {}

#: Commands that do something more when they are repeated: each has a test of its own.
REPEATS_DIFFER: Final = frozenset({"lease", "own", "take_notice", "take"})


def written_by(name: str) -> str:
    """The command that does the write of a case."""
    return name.partition(":")[0]


Prepare = Callable[[World], Callable[[], object]]


def case(name: str, again: object = None, **more: Any) -> Callable[[Prepare], Prepare]:
    """Note a case: its script and what is special; `again` is what is answered the second time."""

    def note(prepare: Prepare) -> Prepare:
        answered = again if callable(again) and not isinstance(again, type) else None
        CASES[name] = Case(prepare, answered or (lambda answer: answer == again), **more)
        return prepare

    return note


def is_anything(_: object) -> bool:
    return True


# What workers write.


@case("commit", "committed")
def _(world: World) -> Callable[[], object]:
    lease = world.leased()
    return lambda: commit(world.queue, lease)


@case("commit: another was first", "duplicate")
def _(world: World) -> Callable[[], object]:
    lease = world.committed()
    return lambda: commit(world.queue, lease, "another partial")


@case("commit: the job has ended", "ended")
def _(world: World) -> Callable[[], object]:
    lease = world.leased()
    Jobs(world.direct).cancel(lease.job_id)
    return lambda: commit(world.queue, lease)


@case("commit: of another variant", "stale")
def _(world: World) -> Callable[[], object]:
    lease = world.leased()
    return lambda: commit(world.queue, replace(lease, variant="llvm_ad_rgb"))


@case("commit: of seeds that were used", "overlap")
def _(world: World) -> Callable[[], object]:
    world.committed()
    found = SliceQueue(world.direct, WORKER, LEASE_S).lease(("scalar_rgb",), None, in_turn=False)
    assert found is not None
    lease = found
    return lambda: commit(world.queue, lease, "another partial", (5, 6))


@case("glimpse", True)
def _(world: World) -> Callable[[], object]:
    lease = world.leased()
    return lambda: world.queue.glimpse(lease, "a glimpse")


@case("died", "lost")
def _(world: World) -> Callable[[], object]:
    lease = world.leased()
    return lambda: world.queue.died(lease, "killed by SIGSEGV", 0.5, "words")


@case("hand_back: the worker does not see the scene's files")
def _(world: World) -> Callable[[], object]:
    lease = world.leased()
    return lambda: world.queue.hand_back(lease, 0.5, cause="files differ", leaves_out=True)


@case("hand_back")
def _(world: World) -> Callable[[], object]:
    lease = world.leased()
    return lambda: world.queue.hand_back(lease, 0.5, cause="the worker stops", said="words")


@case("fail")
def _(world: World) -> Callable[[], object]:
    lease = world.leased()
    return lambda: world.queue.fail(lease, "no such plugin", 0.5, "words")


@case("heartbeat", ())
def _(world: World) -> Callable[[], object]:
    lease = world.leased()
    return lambda: world.queue.heartbeat(ABOUT, (lease,))


@case("leave")
def _(world: World) -> Callable[[], object]:
    world.heartbeat()
    return world.queue.leave


# What monitors write.


@case("renew", set(), writes_only_times=True)
def _(world: World) -> Callable[[], object]:
    world.job()
    return lambda: world.owners.renew((world.owned,))


@case("disown")
def _(world: World) -> Callable[[], object]:
    world.job()
    return lambda: world.owners.disown((world.owned,))


@case("plan")
def _(world: World) -> Callable[[], object]:
    world.job()
    return lambda: world.owners.plan(world.owned, range(2, 6))


@case("append_point")
def _(world: World) -> Callable[[], object]:
    world.committed()
    return lambda: world.owners.append_point(world.owned, 100, {"spp": 100, "visible_pixels": 3})


@case("reject", 0)
def _(world: World) -> Callable[[], object]:
    lease = world.committed()
    [record] = Ownerships(world.direct, LEASE_S).committed(lease.job_id, range(1))
    return lambda: world.owners.reject(world.owned, record, "it is spoiled")


@case("show")
def _(world: World) -> Callable[[], object]:
    world.job()
    return lambda: world.owners.show_results(world.owned, RESULTS, 50, SHA256)


@case("note_blob")
def _(world: World) -> Callable[[], object]:
    blob = blobs.preview(world.job(), 50)
    return lambda: world.owners.note_blob(world.owned, blob, "ab" * 32)


@case("save")
def _(world: World) -> Callable[[], object]:
    world.committed()
    return lambda: world.owners.save_checkpoint(world.owned, CHECKPOINT)


@case("save: a frame waits for a look at its shot")
def _(world: World) -> Callable[[], object]:
    world.committed(batch="walk")
    waits = FrameWait(spp=50, stop=True, reason="levelled off", numbers={})
    return lambda: world.owners.save_checkpoint(world.owned, CHECKPOINT, waits)


@case("answer_frames")
def _(world: World) -> Callable[[], object]:
    asked = {**SPEC, "batch": "walk", "shot": {"fps": 24}, "parameters": [{"frame": 0}] * 2}
    specs = BatchSpec.model_validate(asked).job_specs("walk")
    Jobs(world.direct).create(*specs, name="walk", scene_sha256="00")
    record = Batches(world.direct).shot("walk")
    assert record is not None
    first, last = (frame.job_id for frame in record.frames)
    more = FrameAnswer(spp=50, needs_spp=100, good=True, words="it is noisy")
    answers = {first: more, last: None}
    return lambda: Shots(world.lossy).answer(record, LOOK, "it is noisy", answers)


@case("end")
def _(world: World) -> Callable[[], object]:
    world.committed(notice=NOTICE)
    verdict = {"slope": 0.01}
    state, why = JobState.CONVERGED, "levelled off"
    return lambda: world.owners.end(world.owned, state, "rule", why, verdict, RESULTS, SHA256)


@case("conclude")
def _(world: World) -> Callable[[], object]:
    world.committed()
    Ownerships(world.direct, LEASE_S).end(world.owned, JobState.EXHAUSTED, "cap", "the cap")
    return lambda: world.owners.conclude(
        world.owned, spp=50, results=RESULTS, sha256=SHA256, notes=("a note",)
    )


@case("abandon", FenceLost)
def _(world: World) -> Callable[[], object]:
    job = world.leased().job_id
    world.direct.delete(keys.job(job))
    return lambda: world.owners.abandon(world.owned)


@case("finish", FenceLost)
def _(world: World) -> Callable[[], object]:
    world.committed()
    Ownerships(world.direct, LEASE_S).end(world.owned, JobState.EXHAUSTED, "cap", "the cap")
    return lambda: world.owners.finish(world.owned, keeps_sums=False)


@case("monitor_heartbeat")
def _(world: World) -> Callable[[], object]:
    life = MonitorLife(world.lossy, "monitor-1", LEASE_S)
    return lambda: life.heartbeat(3)


@case("settle_notice: delivered", again=True)
def _(world: World) -> Callable[[], object]:
    world.finished(notice=NOTICE)
    taken = Outbox(world.direct).take(LEASE_S)
    assert taken is not None
    return lambda: world.outbox.settle(taken, "delivered")


@case("settle_notice: failed", again=False)
def _(world: World) -> Callable[[], object]:
    world.finished(notice=NOTICE)
    taken = Outbox(world.direct).take(LEASE_S)
    assert taken is not None
    return lambda: world.outbox.settle(taken, "failed", "no", 60.0)


@case("forget", "missing")
def _(world: World) -> Callable[[], object]:
    job = world.finished()
    return lambda: Scripts(world.lossy).run(Forget(job=job, finished_for_ms=0))


@case("drop_sums", "kept")
def _(world: World) -> Callable[[], object]:
    job = world.finished()
    drop = DropSums(job=job, finished_for_ms=0, continued_by=())
    return lambda: Scripts(world.lossy).run(drop)


@case("forget_scene", "kept")
def _(world: World) -> Callable[[], object]:
    SceneIndex(world.direct).use("c" * 64)
    forget = ForgetScene(sha256="c" * 64, before_ms=2**52, going_ms=60_000)
    return lambda: Scripts(world.lossy).run(forget)


# What APIs write.


@case("create", lambda made: made.repeated and not made.conflict)
def _(world: World) -> Callable[[], object]:
    spec = JobSpec(**SPEC, notice=NOTICE, batch="frames")
    return lambda: world.jobs.create(
        spec, name="box.xml", scene_sha256="0" * 64, idempotency_key="once", digest="d"
    )


@case("continue", lambda made: made.repeated and not made.conflict)
def _(world: World) -> Callable[[], object]:
    job = Jobs(world.direct).get(world.finished())
    goes_on = Continuations(world.lossy)
    remains = Continuations(world.direct).remains(job)
    spec = job.spec.model_copy(update={"max_spp": 2000})
    return lambda: goes_on.start(job, remains, spec, idempotency_key="once")


@case("end: cancelled by a user", lambda job: job.state is JobState.CANCELLED)
def _(world: World) -> Callable[[], object]:
    job = world.leased(notice=NOTICE).job_id
    return lambda: world.jobs.cancel(job)


@case("pause", lambda job: job.state is JobState.PAUSED)
def _(world: World) -> Callable[[], object]:
    job = world.leased().job_id
    return lambda: world.jobs.pause(job)


@case("pause: a batch", is_anything, answers_before=3)
def _(world: World) -> Callable[[], object]:
    world.leased(batch="frames")
    world.job(owned=False, batch="frames")
    return lambda: Batches(world.lossy).steer("frames", Steer.PAUSE)


@case("resume", lambda job: job.state is JobState.RENDERING)
def _(world: World) -> Callable[[], object]:
    job = world.leased().job_id
    Jobs(world.direct).pause(job)
    return lambda: world.jobs.resume(job)


@case("set_deleted", is_anything)
def _(world: World) -> Callable[[], object]:
    job = world.finished(batch="frames")
    return lambda: Deletions(world.lossy).set(job, deleted=True)


@case("set_deleted: restored", is_anything)
def _(world: World) -> Callable[[], object]:
    job = world.finished()
    Deletions(world.direct).set(job, deleted=True)
    return lambda: Deletions(world.lossy).set(job, deleted=False)


@case("reprioritise", lambda job: job.spec.priority == 7)
def _(world: World) -> Callable[[], object]:
    job = world.leased().job_id
    return lambda: world.jobs.set_priority(job, 7)


@case("remember_scene")
def _(world: World) -> Callable[[], object]:
    return lambda: SceneIndex(world.lossy).remember("c" * 64, {"name": "box.xml"})


@case("use_scene")
def _(world: World) -> Callable[[], object]:
    return lambda: SceneIndex(world.lossy).use("c" * 64)


@case("disuse_scene")
def _(world: World) -> Callable[[], object]:
    SceneIndex(world.direct).use("c" * 64)
    return lambda: SceneIndex(world.lossy).disuse("c" * 64)


@case("note_scenes")
def _(world: World) -> Callable[[], object]:
    return lambda: Scripts(world.lossy).run(NoteScenes(scenes=("c" * 64, "d" * 64)))


@case("scene_gone")
def _(world: World) -> Callable[[], object]:
    SceneIndex(world.direct).use("c" * 64)
    forget = ForgetScene(sha256="c" * 64, before_ms=10**14, going_ms=60_000)
    Scripts(world.direct).run(forget)
    return lambda: Scripts(world.lossy).run(SceneGone(sha256="c" * 64))


@case("begin_sweep", False, writes_only_times=True)  # as if the first one had been begun
def _(world: World) -> Callable[[], object]:
    return lambda: is_due(world.lossy, 60.0)


@case("note_sweep", writes_only_times=True)
def _(world: World) -> Callable[[], object]:
    return lambda: note_sweep(world.lossy)


#: A trouble, as it is noted for a target.
TROUBLE: Final = "farm ops idle worker-1"


def noted_troubles(client: redis.Redis) -> object:
    noted = NoteTroubles(scope="farm", found=(TROUBLE,), patience_ms=0, lease_ms=60_000)
    return Scripts(client).run(noted)


# The first one is taken to tell it, and if it does not, it is told when that lease is over.
@case("note_troubles", lambda due: not due)
def _(world: World) -> Callable[[], object]:
    return lambda: noted_troubles(world.lossy)


@case("note_told")
def _(world: World) -> Callable[[], object]:
    noted_troubles(world.direct)
    return lambda: Scripts(world.lossy).run(NoteTold(trouble=TROUBLE))


@case("pair", "an id")
def _(world: World) -> Callable[[], object]:
    return lambda: Scripts(world.lossy).run(Pair(id="an id", is_marked=True))


@case("put_key: of another's making", lambda key: key.usable, answers_before=1)
def _(world: World) -> Callable[[], object]:
    shown = f"plateau_{'a' * 12}_{'b' * 64}"
    limits = world.api_key().limits
    return lambda: world.keys.admit(shown, "a key", Role.VIEWER, limits)


@case("put_key: revoked", lambda key: not key.usable, answers_before=2)
def _(world: World) -> Callable[[], object]:
    key = world.api_key()
    return lambda: world.keys.revoke(key.id)


@case("note_use", writes_only_times=True)
def _(world: World) -> Callable[[], object]:
    key = world.api_key()
    return lambda: world.keys.note_use(key)


@case("drain")
def _(world: World) -> Callable[[], object]:
    world.heartbeat()
    return lambda: world.workers.drain(WORKER)
