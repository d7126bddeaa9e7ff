"""Every write to Redis as a case: how it is prepared, and what is answered when it is repeated."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.ledger.api_keys import ApiKey, ApiKeys, KeyLimits, Role
from plateau.farm.ledger.batches import Batches, Steer
from plateau.farm.ledger.continuation import Continuations, Remains
from plateau.farm.ledger.deletions import Deletions
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.outbox import Outbox, Taken
from plateau.farm.ledger.ownership import Checkpoint, Ownership, Ownerships
from plateau.farm.ledger.queue import Lease, SliceQueue, SliceRecord
from plateau.farm.ledger.scene_index import SceneIndex
from plateau.farm.ledger.shots import ShotRecord, Shots
from plateau.farm.ledger.totals import note_sweep
from plateau.farm.ledger.workers import MonitorLife, Workers
from plateau.farm.model.errors import FenceLost
from plateau.farm.model.job import Job, utc_now
from plateau.farm.model.shot import FrameAnswer, FrameWait, ShotLook
from plateau.farm.model.spec import BatchSpec, JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.redis.commands.command import Command
from plateau.farm.redis.commands.members import Pair
from plateau.farm.redis.commands.notices import NoteTold, NoteTroubles
from plateau.farm.redis.commands.scenes import ForgetScene, NoteScenes, SceneGone
from plateau.farm.redis.commands.sweeps import DropSums, Forget
from plateau.farm.redis.scripts import Scripts
from plateau.farm.sweep import is_due
from tests.support import FRAMES
from tests.support.farms.ledger_farm import lease_scalar, own, record_of
from tests.support.farms.receiver import SECRET

WORKER, OTHER = "worker-1", "worker-2"
LEASE_S = 60.0
NOTICE: Final[dict[str, Any]] = {"url": "https://lab.example/hook", "secret": SECRET}
SPEC: Final[dict[str, Any]] = {**FRAMES, "step": 100, "slice_spp": 50, "max_spp": 1000}
SCENE: Final = "c" * 64
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
            self.owned = own(owners, made.job.id)
            owners.plan(self.owned, range(slices))
        return made.job.id

    def leased(self, **spec: Any) -> Lease:
        """A slice that the worker has leased."""
        self.job(**spec)
        return self.another()

    def another(self) -> Lease:
        """The next slice that the worker has leased."""
        return lease_scalar(SliceQueue(self.direct, WORKER, LEASE_S))

    def committed(self, **spec: Any) -> Lease:
        """A slice that was committed by the worker."""
        lease = self.leased(**spec)
        assert commit(SliceQueue(self.direct, WORKER, LEASE_S), lease) == "committed"
        return lease

    def ended(self) -> None:
        """A job that has reached its cap with one slice."""
        self.committed()
        Ownerships(self.direct, LEASE_S).end(self.owned, JobState.EXHAUSTED, "cap", "the cap")

    def finished(self, **spec: Any) -> str:
        """A job that converged with one slice, and is done with."""
        job = self.committed(**spec).job_id
        owners = Ownerships(self.direct, LEASE_S)
        owners.save_checkpoint(self.owned, CHECKPOINT)
        owners.end(self.owned, JobState.CONVERGED, "rule", "levelled off", {"slope": 0.0}, RESULTS)
        owners.finish(self.owned, keeps_sums=True)
        return job

    def taken(self) -> Taken:
        """A notice that is leased."""
        self.finished(notice=NOTICE)
        taken = Outbox(self.direct).take(LEASE_S)
        assert taken is not None
        return taken

    def scene_in_use(self) -> None:
        SceneIndex(self.direct).use(SCENE)

    def run(self, command: Command[Any]) -> Any:
        return Scripts(self.lossy).run(command)

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
    seeds = seeds or (lease.index * 10, lease.index * 10 + 9)
    record = record_of(lease, seeds, blob=blob, worker=WORKER)
    return queue.commit(lease, record, width=32, height=24, notes=(), said="words")


@dataclass(frozen=True)
class Case:
    """A write."""

    prepare: Callable[[World], Any]
    write: Callable[[World, Any], object]  #: the write itself, of what `prepare` has returned
    is_answered: Callable[[object], bool]  #: whether this is what the one who repeats it should get
    answers_before: int = 0  #: to what it reads first
    writes_only_times: bool = False


CASES: dict[str, Case] = {}

#: Commands that do something more when they are repeated: each has a test of its own.
REPEATS_DIFFER: Final = frozenset({"lease", "own", "take_notice"})


def written_by(name: str) -> str:
    """The command that does the write of a case."""
    return name.partition(":")[0]


def case(
    name: str,
    prepare: Callable[[World], Any],
    write: Callable[[World, Any], object],
    again: object = None,
    **more: Any,
) -> None:
    """Note a case; `again` is what is answered the second time, or a function that knows it."""
    answered = again if callable(again) and not isinstance(again, type) else None
    CASES[name] = Case(prepare, write, answered or (lambda answer: answer == again), **more)


def nothing(_: object) -> None:
    """Nothing is to be prepared."""


def is_anything(_: object) -> bool:
    return True


# What workers write.

case("commit", World.leased, lambda w, held: commit(w.queue, held), "committed")
case(
    "commit: another was first",
    World.committed,
    lambda w, held: commit(w.queue, held, "another partial"),
    "duplicate",
)


def _job_has_ended(world: World) -> Lease:
    lease = world.leased()
    Jobs(world.direct).cancel(lease.job_id)
    return lease


case("commit: the job has ended", _job_has_ended, lambda w, held: commit(w.queue, held), "ended")
case(
    "commit: of another variant",
    World.leased,
    lambda w, held: commit(w.queue, replace(held, variant="llvm_ad_rgb")),
    "stale",
)


def _another_of_the_job(world: World) -> Lease:
    world.committed()
    return world.another()


case(
    "commit: of seeds that were used",
    _another_of_the_job,
    lambda w, held: commit(w.queue, held, "another partial", (5, 6)),
    "overlap",
)
case("glimpse", World.leased, lambda w, held: w.queue.glimpse(held, "a glimpse"), True)
case("died", World.leased, lambda w, held: w.queue.died(held, "SIGSEGV", 0.5, "words"), "lost")
case(
    "hand_back: the worker does not see the scene's files",
    World.leased,
    lambda w, held: w.queue.hand_back(held, 0.5, cause="files differ", leaves_out=True),
)
case(
    "hand_back",
    World.leased,
    lambda w, held: w.queue.hand_back(held, 0.5, cause="the worker stops", said="words"),
)
case("fail", World.leased, lambda w, held: w.queue.fail(held, "no such plugin", 0.5, "words"))
case("heartbeat", World.leased, lambda w, held: w.queue.heartbeat(ABOUT, (held,)), ())
case("leave", World.heartbeat, lambda w, _: w.queue.leave())

# What monitors write.

case("renew", World.job, lambda w, _: w.owners.renew((w.owned,)), set(), writes_only_times=True)
case("disown", World.job, lambda w, _: w.owners.disown((w.owned,)))
case("plan", World.job, lambda w, _: w.owners.plan(w.owned, range(2, 6)))
case(
    "append_point",
    World.committed,
    lambda w, _: w.owners.append_point(w.owned, 100, {"spp": 100, "visible_pixels": 3}),
)


def _its_record(world: World) -> SliceRecord:
    lease = world.committed()
    [record] = Ownerships(world.direct, LEASE_S).committed(lease.job_id, range(1))
    return record


case("reject", _its_record, lambda w, record: w.owners.reject(w.owned, record, "spoiled"), 0)
case("show", World.job, lambda w, _: w.owners.show_results(w.owned, RESULTS, 50, SHA256))
case(
    "note_blob",
    World.job,
    lambda w, job: w.owners.note_blob(w.owned, blobs.preview(job, 50), "ab" * 32),
)
case("save", World.committed, lambda w, _: w.owners.save_checkpoint(w.owned, CHECKPOINT))
case(
    "save: a frame waits for a look at its shot",
    lambda w: w.committed(batch="walk"),
    lambda w, _: w.owners.save_checkpoint(
        w.owned, CHECKPOINT, FrameWait(spp=50, stop=True, reason="levelled off", numbers={})
    ),
)


def _shot(world: World) -> ShotRecord:
    asked = {**SPEC, "batch": "walk", "shot": {"fps": 24}, "parameters": [{"frame": 0}] * 2}
    specs = BatchSpec.model_validate(asked).job_specs("walk")
    Jobs(world.direct).create(*specs, name="walk", scene_sha256="00")
    record = Batches(world.direct).shot("walk")
    assert record is not None
    return record


def _answer(world: World, record: ShotRecord) -> None:
    first, last = (frame.job_id for frame in record.frames)
    more = FrameAnswer(spp=50, needs_spp=100, good=True, words="it is noisy")
    Shots(world.lossy).answer(record, LOOK, "it is noisy", {first: more, last: None})


case("answer_frames", _shot, _answer)
case(
    "end",
    lambda w: w.committed(notice=NOTICE),
    lambda w, _: w.owners.end(
        w.owned, JobState.CONVERGED, "rule", "levelled off", {"slope": 0.01}, RESULTS, SHA256
    ),
)
case(
    "conclude",
    World.ended,
    lambda w, _: w.owners.conclude(
        w.owned, spp=50, results=RESULTS, sha256=SHA256, notes=("a note",)
    ),
)
case(
    "abandon",
    lambda w: w.direct.delete(keys.job(w.leased().job_id)),
    lambda w, _: w.owners.abandon(w.owned),
    FenceLost,
)
case("finish", World.ended, lambda w, _: w.owners.finish(w.owned, keeps_sums=False), FenceLost)
case(
    "monitor_heartbeat",
    nothing,
    lambda w, _: MonitorLife(w.lossy, "monitor-1", LEASE_S).heartbeat(3),
)
case(
    "settle_notice: delivered",
    World.taken,
    lambda w, taken: w.outbox.settle(taken, "delivered"),
    True,
)
case(
    "settle_notice: failed",
    World.taken,
    lambda w, taken: w.outbox.settle(taken, "failed", "no", 60.0),
    False,
)
case("forget", World.finished, lambda w, job: w.run(Forget(job=job, finished_for_ms=0)), "missing")
case(
    "drop_sums",
    World.finished,
    lambda w, job: w.run(DropSums(job=job, finished_for_ms=0, continued_by=())),
    "kept",
)
FORGET_SCENE: Final = ForgetScene(sha256=SCENE, before_ms=2**52, going_ms=60_000)
case("forget_scene", World.scene_in_use, lambda w, _: w.run(FORGET_SCENE), "kept")


def _going_scene(world: World) -> None:
    world.scene_in_use()
    Scripts(world.direct).run(FORGET_SCENE)


case("scene_gone", _going_scene, lambda w, _: w.run(SceneGone(sha256=SCENE)))
case("note_scenes", nothing, lambda w, _: w.run(NoteScenes(scenes=(SCENE, "d" * 64))))
# The second one is answered as if the first one had been begun.
case("begin_sweep", nothing, lambda w, _: is_due(w.lossy, 60.0), False, writes_only_times=True)
case("note_sweep", nothing, lambda w, _: note_sweep(w.lossy), writes_only_times=True)

#: A trouble, as it is noted for a target.
TROUBLE: Final = "farm ops idle worker-1"
NOTED: Final = NoteTroubles(scope="farm", found=(TROUBLE,), patience_ms=0, lease_ms=60_000)

# The first one is taken to tell it, and if it does not, it is told when that lease is over.
case("note_troubles", nothing, lambda w, _: w.run(NOTED), lambda due: not due)
case(
    "note_told",
    lambda w: Scripts(w.direct).run(NOTED),
    lambda w, _: w.run(NoteTold(trouble=TROUBLE)),
)

# What APIs write.


def _repeats(made: Any) -> bool:
    return bool(made.repeated and not made.conflict)


case(
    "create",
    nothing,
    lambda w, _: w.jobs.create(
        JobSpec(**SPEC, notice=NOTICE, batch="frames"),
        name="box.xml",
        scene_sha256="0" * 64,
        idempotency_key="once",
        digest="d",
    ),
    _repeats,
)


def _remains(world: World) -> tuple[Job, Remains | None]:
    job = Jobs(world.direct).get(world.finished())
    return job, Continuations(world.direct).remains(job)


def _go_on(world: World, had: tuple[Job, Remains]) -> object:
    spec = had[0].spec.model_copy(update={"max_spp": 2000})
    return Continuations(world.lossy).start(*had, spec, idempotency_key="once")


case("continue", _remains, _go_on, _repeats)
case(
    "end: cancelled by a user",
    lambda w: w.leased(notice=NOTICE).job_id,
    lambda w, job: w.jobs.cancel(job),
    lambda job: job.state is JobState.CANCELLED,
)
case(
    "pause",
    World.leased,
    lambda w, held: w.jobs.pause(held.job_id),
    lambda job: job.state is JobState.PAUSED,
)


def _batch(world: World) -> None:
    world.leased(batch="frames")
    world.job(owned=False, batch="frames")


case(
    "pause: a batch",
    _batch,
    lambda w, _: Batches(w.lossy).steer("frames", Steer.PAUSE),
    is_anything,
    answers_before=3,
)
case(
    "resume",
    lambda w: Jobs(w.direct).pause(w.leased().job_id).id,
    lambda w, job: w.jobs.resume(job),
    lambda job: job.state is JobState.RENDERING,
)
case(
    "set_deleted",
    lambda w: w.finished(batch="frames"),
    lambda w, job: Deletions(w.lossy).set(job, deleted=True),
    is_anything,
)


def _deleted(world: World) -> str:
    job = world.finished()
    Deletions(world.direct).set(job, deleted=True)
    return job


case(
    "set_deleted: restored",
    _deleted,
    lambda w, job: Deletions(w.lossy).set(job, deleted=False),
    is_anything,
)
case(
    "reprioritise",
    World.leased,
    lambda w, held: w.jobs.set_priority(held.job_id, 7),
    lambda job: job.spec.priority == 7,
)
case(
    "remember_scene", nothing, lambda w, _: SceneIndex(w.lossy).remember(SCENE, {"name": "box.xml"})
)
case("use_scene", nothing, lambda w, _: SceneIndex(w.lossy).use(SCENE))
case("disuse_scene", World.scene_in_use, lambda w, _: SceneIndex(w.lossy).disuse(SCENE))
case("pair", nothing, lambda w, _: w.run(Pair(id="an id", is_marked=True)), "an id")
case(
    "put_key: of another's making",
    nothing,
    lambda w, _: w.keys.admit(f"plateau_{'a' * 12}_{'b' * 64}", "a key", Role.VIEWER, KeyLimits()),
    lambda key: key.usable,
    answers_before=1,
)
case(
    "put_key: revoked",
    World.api_key,
    lambda w, key: w.keys.revoke(key.id),
    lambda key: not key.usable,
    answers_before=2,
)
case("note_use", World.api_key, lambda w, key: w.keys.note_use(key), writes_only_times=True)
case("drain", World.heartbeat, lambda w, _: w.workers.drain(WORKER))
