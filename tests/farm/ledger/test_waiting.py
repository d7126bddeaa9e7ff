"""A lease finds its job by an index; here it is held against a look at every open job."""

from collections import Counter, defaultdict
from collections.abc import Iterator
from itertools import count
from typing import NamedTuple

import pytest
import redis
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Ownership, Ownerships
from plateau.farm.ledger.queue import Lease, SliceQueue
from plateau.farm.ledger.workers import Workers
from plateau.farm.model.fit import WorkerClass
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import MAX_TRIES, JobState
from plateau.farm.process.waits import Stop
from plateau.farm.redis import keys
from plateau.farm.redis.commands import slices as commands
from plateau.farm.redis.commands.jobs import End, Pause, Reprioritise, Resume
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from plateau.farm.redis.scripts import Scripts, library
from plateau.farm.redis.wake import Wake
from tests.support.farms.ledger_farm import own, record_of
from tests.support.long_tests import WANTED
from tests.support.until import until

LEASE_S = 600  # nothing runs out by itself
WORKERS = {
    "gpu": WorkerClass(("cuda_ad_rgb", "llvm_ad_rgb", "scalar_rgb"), tags=("gpu", "highmem")),
    "cpu": WorkerClass(("llvm_ad_rgb", "scalar_rgb")),
    "old": WorkerClass(("scalar_rgb",), tags=("highmem",)),
    "far": WorkerClass(("llvm_ad_rgb", "scalar_rgb"), pool="far", tags=("gpu",)),
}
LONG_AGO, LONG_TO_COME, USUAL_MS = "1", "9000000000000", 500


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Iterator[redis.Redis]:
    """A Redis that does not wait for its disk, since histories are long."""
    server = EmbeddedRedis(tmp_path_factory.mktemp("quick"))
    client = connect(server.url, 120.0)
    client.config_set("appendfsync", "no")
    yield client
    client.close()
    server.stop()


class Found(NamedTuple):
    """A job that waits."""

    queue: tuple[str, str]  #: its variant and its need
    owner: str
    group: object  #: its batch, or itself
    number: int
    id: str


class History:
    """A farm to which anything may happen, in any order."""

    def __init__(self, client: redis.Redis) -> None:
        client.flushall()
        self.client = client
        self.jobs = Jobs(client)
        self.owners = Ownerships(client, lease_s=600)
        self.queues = {
            name: SliceQueue(client, name, LEASE_S, pool=kind.pool, tags=kind.tags)
            for name, kind in WORKERS.items()
        }
        self.late: set[tuple[str, str]] = set()  # entries of jobs that are leased for long
        self.made: list[tuple[Ownership, JobSpec]] = []
        self.leases: list[tuple[str, Lease]] = []
        self.loaded = dict.fromkeys(WORKERS, "")
        self.planned: dict[str, int] = defaultdict(int)

    def happens(self, kind: str, a: int, b: int) -> None:
        getattr(self, kind)(a, b)

    # Jobs

    def create(self, a: int, b: int) -> None:
        spec = JobSpec(
            allocation="frame",
            priority=a % 3 - 1,
            batch=(None, "one", "two:auto 0", None)[b % 4],
            variant=("auto", "scalar_rgb", "llvm_ad_rgb", "scalar_rgb")[a // 3 % 4],
            slice_spp=(25, 100)[b // 4 % 2],
            pool=("default", "default", "far")[a // 36 % 3],
            requires=((), (), (), ("gpu",), ("gpu", "highmem"))[b // 8 % 5],
        )
        owner = ("", "0123456789ab", "cafecafecafe")[a // 12 % 3]
        job = self.jobs.create(spec, name="box", scene_sha256="00", owner=owner).job
        owned = own(self.owners, job.id)
        self.made.append((owned, spec))
        self.plan(-1, b % 3)
        for worker in ((), (), ("cpu",), ("cpu", "gpu"))[b // 32 % 4]:
            self.left_out(worker, job.id)

    def plan(self, a: int, b: int) -> None:
        if self.made:
            owned, _ = self.made[a % len(self.made)]
            planned = self.planned[owned.job_id]
            self.owners.plan(owned, range(planned, planned + b % 3))
            self.planned[owned.job_id] += b % 3

    def steer(self, a: int, b: int) -> None:
        """Pause, resume, hold back, change the priority, cancel or fail a job."""
        if not self.made:
            return
        owned, _ = self.made[a % len(self.made)]
        scripts = Scripts(self.client)
        way = b % 6
        if way == 0:
            scripts.run(Pause(job=owned.job_id, reason="held", holds_back=True))
        elif way in {1, 2}:
            scripts.run(Resume(job=owned.job_id, reason="resumed"))
        elif way in {3, 4}:
            scripts.run(Reprioritise(job=owned.job_id, priority=b // 6 % 3 - 1))
        else:
            scripts.run(
                End(job=owned.job_id, target="cancelled", ended_by="person", reason="cancelled")
            )

    def leave_out(self, a: int, b: int) -> None:
        """A worker is left out of a job, or has been left out of all for long enough."""
        worker = sorted(WORKERS)[a % len(WORKERS)]
        if b % 4 == 0:
            self.client.hdel(keys.worker(worker), "left_out")
        elif self.made:
            self.left_out(worker, self.made[b % len(self.made)][0].job_id)

    def left_out(self, worker: str, job_id: str) -> None:
        had = self.client.hget(keys.worker(worker), "left_out") or ""
        self.client.hset(keys.worker(worker), "left_out", f"{had} {job_id} {LONG_TO_COME}".strip())

    # Slices

    def lease(self, a: int, b: int) -> None:
        worker = sorted(WORKERS)[a % len(WORKERS)]
        kind = WORKERS[worker]
        lease = commands.Lease(
            worker=worker,
            kind=kind.text,
            loaded=self.loaded[worker] or "",
            in_turn=b % 2 == 1,
            lease_ms=LEASE_S * 1000,
            most_tries=MAX_TRIES,
        )
        offer = commands.Offer(again=True)
        while offer.again:
            self.stop_the_clock()
            note_what_ran_out(self.client)  # which may free a job of its variant
            late = late_slices(self.client, kind, worker, {job_id for job_id, _ in self.late})
            expected = scan(self.client, kind, worker, self.loaded[worker], in_turn=b % 2 == 1)
            if expected is None:  # then the slice that holds up another job's image
                expected = min(late, default=None)
            offer = Scripts(self.client).run(lease)
        found = offer.slice
        if expected is None:
            assert found is None
            return
        assert found is not None
        assert found.job == expected
        if expected in late:
            assert found.index == late[expected]
        spec = next(spec for owned, spec in self.made if owned.job_id == expected)
        held = Lease(
            job_id=found.job,
            entry=found.entry,
            index=found.index,
            tries=found.tries,
            variant=found.variant,
            spec=spec,
            scene_sha256="00",
        )
        self.leases.append((worker, held))
        self.loaded[worker] = held.job_id

    def dawdle(self, a: int, b: int) -> None:
        """A slice takes its worker very long."""
        if self.leases:
            _, held = self.leases[a % len(self.leases)]
            self.late.add((held.job_id, held.entry))

    def stop_the_clock(self) -> None:
        """Slices are late, or not, by what happens here alone."""
        jobs = self.client.zrange(keys.OPEN, 0, -1)
        reads, writes = self.client.pipeline(), self.client.pipeline()
        for job_id in jobs:
            reads.hgetall(keys.job(job_id, "leases"))
            reads.hmget(keys.job(job_id), "prefix", "late_ms", "late")
        answers = iter(reads.execute())
        for job_id, leases, (prefix, late_ms, filed) in zip(jobs, answers, answers, strict=True):
            job = keys.job(job_id)
            since = {}
            for index, noted in leases.items():
                entries = noted.partition(" ")[2]
                late = (job_id, entries.split()[1]) in self.late
                since[index] = LONG_AGO if late else LONG_TO_COME
                writes.hset(keys.job(job_id, "leases"), index, f"{since[index]} {entries}")
            writes.delete(keys.job(job_id, "paces"))
            if late_ms:
                writes.hset(job, "late_ms", USUAL_MS)
            if filed:
                class_, late_at = filed.partition(" ")[2], int(since[prefix or "0"]) + USUAL_MS
                writes.zadd(keys.LATE, {f"{job_id} {class_}": late_at}, xx=True)
                writes.hset(job, "late", f"{late_at} {class_}")
        writes.execute()

    def commit(self, a: int, b: int) -> None:
        """A commit in time, or, where the slice has gone to another, a late one."""
        if not self.leases:
            return
        worker, held = self.leases[a % len(self.leases)]
        record = record_of(
            held, blob=f"{held.index}-{worker}-{held.tries}", worker=worker, render_s=1.0
        )
        self.queues[worker].commit(held, record, width=8, height=4, notes=())
        if b % 3:
            self.leases.remove((worker, held))

    def give_up(self, a: int, b: int) -> None:
        """Hand a slice back, die on it, or find that its scene is bad."""
        if not self.leases:
            return
        worker, held = self.leases.pop(a % len(self.leases))
        if b % 4 < 2:
            self.queues[worker].hand_back(
                held, 1.0, cause="draining", unfit=b % 2 == 1, leaves_out=b % 8 >= 4
            )
        elif b % 4 == 2:
            self.queues[worker].died(held, "a crash", 1.0)
        elif b % 16 == 3:
            self.queues[worker].fail(held, "a bad scene")

    def run_out(self, a: int, b: int) -> None:
        """A worker falls silent; maybe another lives on under its name, and renews it later."""
        if not self.leases:
            return
        _, held = self.leases[a % len(self.leases)]
        slices, member = keys.job(held.job_id, "slices"), f"{held.job_id} {held.entry}"
        if self.client.zscore(keys.LEASES, member) is None:
            return
        self.client.zadd(keys.LEASES, {member: 1})
        at = self.client.xpending_range(slices, keys.GROUP, held.entry, held.entry, 1)[0]
        self.client.xclaim(
            slices, keys.GROUP, at["consumer"], 0, [held.entry], idle=10**9, justid=True
        )

    def renew(self, a: int, b: int) -> None:
        worker = sorted(WORKERS)[a % len(WORKERS)]
        held = tuple(lease for holder, lease in self.leases if holder == worker)
        kind = WORKERS[worker]
        about = {"variants": kind.variants, "pool": kind.pool, "tags": kind.tags}
        self.queues[worker].heartbeat(about, held[: 1 + b % 3])

    def reject(self, a: int, b: int) -> None:
        if not self.made:
            return
        owned, _ = self.made[a % len(self.made)]
        records = self.owners.committed(owned.job_id, range(4))
        if records:
            self.owners.reject(owned, records[b % len(records)], "its partial is spoiled")


def scan(
    client: redis.Redis, kind: WorkerClass, worker: str, loaded: str, *, in_turn: bool
) -> str | None:
    """The job that the next slice is of, by looking at every open one, its stream included."""
    of_owner: dict[str, int] = defaultdict(int)
    in_group: dict[object, int] = defaultdict(int)
    left_out = left_out_of(client, worker)
    priority, found = None, []
    for job_id, at in client.zrevrange(keys.OPEN, 0, -1, withscores=True):
        if at != priority:
            if any(one.id not in left_out for one in found):
                break
            priority, found = at, []
        job = client.hgetall(keys.job(job_id))
        slices, owner = keys.job(job_id, "slices"), job.get("party", "")
        group = (owner, job["batch"]) if job["batch"] else job_id
        pending = client.xpending_range(slices, keys.GROUP, "-", "+", 1000)
        of_owner[owner] += len(pending) * int(job["slice_spp"])
        in_group[group] += len(pending) * int(job["slice_spp"])
        stale = [one for one in pending if one["time_since_delivered"] >= LEASE_S * 1000]
        if (
            suits(kind, job)
            and job["state"] in {JobState.QUEUED, JobState.RENDERING}
            and "held" not in job
            and (stale or int(job["ready"]) > 0)
        ):
            queue = (job.get("variant", job["asked_variant"]), job["need"])
            found.append(Found(queue, owner, group, int(job["number"]), job_id))
    if in_turn and loaded not in left_out and any(one.id == loaded for one in found):
        return loaded

    # The first owner, group and job, by the first jobs of each in their queue; a worker that is
    # left out of that job takes the next of the same owner.
    of_queue: dict[object, tuple[int, int]] = {}
    for one in sorted(found, key=lambda one: (in_group[one.group], one.number)):
        for part in ((one.queue, "owner", one.owner), (one.queue, "group", one.group)):
            of_queue.setdefault(part, (in_group[one.group], one.number))
    found.sort(
        key=lambda one: (
            of_owner[one.owner],
            of_queue[one.queue, "owner", one.owner],
            of_queue[one.queue, "group", one.group],
            one.number,
        )
    )
    return next((one.id for one in found if one.id not in left_out), None)


def left_out_of(client: redis.Redis, worker: str) -> set[str]:
    return set((client.hget(keys.worker(worker), "left_out") or "").split()[::2])


def suits(kind: WorkerClass, job: dict[str, str]) -> bool:
    spec, wanted = (
        JobSpec.model_validate_json(job["spec"]),
        job.get("variant", job["asked_variant"]),
    )
    return (
        (wanted == "auto" or wanted in kind.variants)
        and spec.pool == kind.pool
        and all(tag in kind.tags for tag in spec.requires)
    )


def late_slices(
    client: redis.Redis, kind: WorkerClass, worker: str, dawdling: set[str]
) -> dict[str, int]:
    """Of each of these jobs that this worker may help, the slice that holds it up."""
    found = {}
    mine = dawdling - left_out_of(client, worker)
    for job_id in mine.intersection(client.zrange(keys.OPEN, 0, -1)):
        job, slices = client.hgetall(keys.job(job_id)), keys.job(job_id, "slices")
        waits = int(job["ready"]) - int(job["planned"]) + int(job["issued"])
        if job["state"] != JobState.RENDERING or not suits(kind, job) or waits:
            continue
        pending = client.xpending_range(slices, keys.GROUP, "-", "+", 1000)
        if any(one["time_since_delivered"] >= LEASE_S * 1000 for one in pending):
            continue
        done = client.hkeys(keys.job(job_id, "ledger"))
        prefix = next(index for index in count() if str(index) not in done)
        indices = dict(client.xrange(slices))
        tries = [one for one in pending if indices[one["message_id"]]["index"] == str(prefix)]
        since = (client.hget(keys.job(job_id, "leases"), prefix) or "").partition(" ")[0]
        if (
            [one["consumer"] == worker for one in tries] == [False]
            and since == LONG_AGO
            and "late_ms" in job
        ):
            found[job_id] = prefix
    return found


def index(client: redis.Redis) -> dict[str, object]:
    """All that only the index has: its keys, and what is filed of each open job."""
    found: dict[str, object] = {}
    for key in client.scan_iter(f"{keys.PREFIX}*", count=10_000):
        if key.startswith(f"{keys.PREFIX}share:") or key == keys.NEEDS:
            found[key] = client.hgetall(key)
        elif key.startswith(keys.WAITING) or key.endswith(":lost"):
            found[key] = client.zrange(key, 0, -1, withscores=True)
    leases = client.zrange(keys.LEASES, 0, -1)
    if leases:
        found[keys.LEASES] = sorted(leases)
    for job_id in client.zrange(keys.OPEN, 0, -1):
        found[job_id] = client.hmget(keys.job(job_id), "filed", "leased")
    return found


#: Knows nothing of the index: it only files each open job.
FILES_ALL = "for _, id in ipairs(redis.call('ZRANGE', OPEN, 0, -1)) do changed[id] = true end"


def make_index_afresh(client: redis.Redis) -> None:
    """Take the queues and shares away, and file all jobs."""
    for key in index(client):
        if key.startswith((keys.WAITING, f"{keys.PREFIX}share:")):
            client.delete(key)
    for job_id in client.zrange(keys.JOBS, 0, -1):
        client.hdel(keys.job(job_id), "filed")
    client.eval(f"{library()}\n{FILES_ALL}\nWaiting.file_changed()", 0)


def note_what_ran_out(client: redis.Redis) -> None:
    """As every lease does, also that of a worker which takes no work."""
    client.hset(keys.worker("drained"), "drained", 1)
    assert SliceQueue(client, "drained", LEASE_S).lease(("x",), None, in_turn=False) is None


NUMBERS = st.integers(0, 2**16)
KINDS = [
    *("create", "plan", "steer", "leave_out", "commit", "give_up"),
    *("run_out", "renew", "reject", "dawdle"),
]
HISTORIES = st.lists(
    st.tuples(st.sampled_from([*KINDS, *["lease"] * len(KINDS)]), NUMBERS, NUMBERS),
    min_size=20,
    max_size=80,
)


@settings(
    max_examples=2000 if WANTED else 15,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(HISTORIES)
def test_the_index_chooses_as_a_look_at_every_job_does(
    quick: redis.Redis, events: list[tuple[str, int, int]]
) -> None:
    # Whatever happens to a farm, in which every lease is the one that a scan of all jobs chooses
    history = History(quick)
    for number in range(4):
        history.create(7 * number, 5 * number)
    for event in events:
        history.happens(*event)
    # A slice is never given to more than two
    for job_id in quick.zrange(keys.OPEN, 0, -1):
        entries = quick.xrange(keys.job(job_id, "slices"))
        assert max(Counter(one["index"] for _, one in entries).values(), default=0) <= 2
    # The index is the same as one that is made afresh
    note_what_ran_out(quick)
    kept = index(quick)
    make_index_afresh(quick)
    note_what_ran_out(quick)
    assert index(quick) == kept
    # So the next leases are those that they would have been
    history.lease(0, 0)
    history.lease(1, 0)
    # And when all jobs have ended, nothing is left of it
    for owned, _ in history.made:
        if not history.jobs.get(owned.job_id).state.ended:
            history.jobs.cancel(owned.job_id)
    assert index(quick) == {}


@pytest.mark.parametrize("batch", [None, "batch"])
def test_a_lease_asks_no_more_of_redis_where_more_jobs_wait(
    quick: redis.Redis, batch: str | None
) -> None:
    def commands() -> int:
        return sum(one["calls"] for one in quick.info("commandstats").values())

    def cost() -> int:
        before = commands()
        assert queue.lease(WORKERS["cpu"].variants, None, in_turn=False) is not None
        return commands() - before

    history, queue = History(quick), SliceQueue(quick, "one", LEASE_S)
    found = []
    for more in (10, 200):
        for _ in range(more):
            spec = JobSpec(batch=batch)
            job = history.jobs.create(spec, name="box", scene_sha256="00").job
            owned = own(history.owners, job.id)
            # However many slices are planned, the stream has those that are leased
            history.owners.plan(owned, range(1_000_000))
            assert quick.xlen(keys.job(job.id, "slices")) == 0
        found.append(min(cost() for _ in range(4)))  # the first of a job starts it
    assert found[0] == found[1]


class TestIdleWorkers:
    """Those that had nothing to do are woken when there is something, and no more than it takes."""

    @pytest.fixture
    def stop(self) -> Stop:
        return Stop()

    def idle(self, client: redis.Redis, *workers: str) -> dict[str, Wake]:
        """These workers, each of which was given nothing."""
        waiting = {name: Wake(client, keys.wake_worker(name)) for name in workers}
        for name, wake in waiting.items():
            wake.wait(0.0, Stop())
            kind = WORKERS[name.partition("-")[0]]
            queue = SliceQueue(client, name, LEASE_S, pool=kind.pool, tags=kind.tags)
            assert queue.lease(kind.variants, None, in_turn=False) is None
        return waiting

    def woken(self, waiting: dict[str, Wake], stop: Stop) -> set[str]:
        return {name for name, wake in waiting.items() if wake.wait(0.2, stop)}

    def test_one_for_each_slice(self, quick: redis.Redis, stop: Stop) -> None:
        history = History(quick)
        waiting = self.idle(quick, *(f"cpu-{number}" for number in range(5)))
        history.create(1, 2)  # two slices, of any variant
        first = self.woken(waiting, stop)
        assert len(first) == 2
        # The first lease chooses a variant: for the other slice another is woken, who has it
        queues = [SliceQueue(quick, name, LEASE_S) for name in sorted(first)]
        taken = [queue.lease(WORKERS["cpu"].variants, None, in_turn=False) for queue in queues]
        assert None not in taken
        second = self.woken(waiting, stop)
        assert len(second) == 1
        # If one gives its slice back, another is woken for that
        assert taken[0] is not None
        queues[0].hand_back(taken[0])
        assert len(self.woken(waiting, stop) - first - second) == 1

    def test_who_can_render_it(self, quick: redis.Redis, stop: Stop) -> None:
        history = History(quick)
        waiting = self.idle(quick, "old-1", "cpu-1", "old-2")
        history.create(6, 1)  # one slice, for LLVM
        assert self.woken(waiting, stop) == {"cpu-1"}

    def test_not_one_that_died(self, quick: redis.Redis, stop: Stop) -> None:
        history = History(quick)
        waiting = self.idle(quick, "cpu-1", "cpu-2", "cpu-3")
        for name in ("cpu-1", "cpu-2"):
            waiting.pop(name).close()  # as its connections do when it is killed
            channel = keys.wake_worker(name)
            until(lambda channel=channel: quick.pubsub_numsub(channel) == [(channel, 0)])
        history.create(1, 1)
        assert self.woken(waiting, stop) == {"cpu-3"}

    def test_nor_one_that_is_drained(self, quick: redis.Redis, stop: Stop) -> None:
        history = History(quick)
        waiting = self.idle(quick, "cpu-1", "cpu-2")
        history.queues["cpu"].heartbeat({}, ())
        SliceQueue(quick, "cpu-1", LEASE_S).heartbeat({}, ())
        Workers(quick).drain("cpu-1")
        history.create(1, 1)
        assert self.woken(waiting, stop) == {"cpu-2"}
