"""A slice that is late and holds up its job's image is given to a second worker: one try counts."""

import pytest
import redis

from plateau.farm.ledger.ownership import Ownership
from plateau.farm.ledger.queue import Lease
from plateau.farm.ledger.totals import take_census
from plateau.farm.model.job import Job
from plateau.farm.process.waits import Stop
from plateau.farm.redis import keys
from plateau.farm.redis.wake import Wake
from tests.support.farms.ledger_farm import VARIANTS, LedgerFarm, commit

USUAL_MS = 200_000  # a slice that takes so long is no slower than the others


class Farm(LedgerFarm):
    """Workers, and a clock that is turned back rather than waited for."""

    def __init__(self, client: redis.Redis) -> None:
        super().__init__(client)
        self.held: dict[str, Lease] = {}  #: by worker: what it was last given

    def lease(self, worker: str) -> Lease | None:
        queue = self.worker(worker)
        found = queue.lease(VARIANTS, None, in_turn=False)
        if found is not None:
            self.held[worker] = found
        return found

    def index(self, worker: str) -> int | None:
        """The slice that the worker is given."""
        found = self.lease(worker)
        return None if found is None else found.index

    def commit(self, worker: str, held: Lease | None = None) -> str:
        held = held or self.held[worker]
        blob = f"{held.index}-{worker}-{held.tries}"
        return commit(self.worker(worker), held, worker=worker, blob=blob)

    def passes(self, ms: float) -> None:
        """All that is leased has been so for longer by this."""
        for job_id in self.client.zrange(keys.OPEN, 0, -1):
            leases = keys.job(job_id, "leases")
            for index, noted in self.client.hgetall(leases).items():
                since, _, entries = noted.partition(" ")
                self.client.hset(leases, index, f"{float(since) - ms} {entries}")
        for member, at in self.client.zrange(keys.LATE, 0, -1, withscores=True):
            job_id, _, class_ = member.partition(" ")
            self.client.zadd(keys.LATE, {member: at - ms})
            self.client.hset(keys.job(job_id), "late", f"{at - ms} {class_}")

    def slow_and_quick(self, slices: int = 8, **spec: object) -> tuple[Job, Ownership]:
        """A job whose slice 0 the slow worker has, while the quick one has rendered slice 1."""
        job, owned = self.job(slices, **spec)
        assert self.index("slow") == 0
        assert self.index("quick") == 1
        self.passes(USUAL_MS)
        self.commit("quick")
        return job, owned


@pytest.fixture
def farm(client: redis.Redis) -> Farm:
    return Farm(client)


def test_a_slice_is_late_that_takes_twice_as_long_as_others(farm: Farm) -> None:
    farm.slow_and_quick()
    # After as long as slices take, nothing is late, and the quick worker goes on
    assert farm.index("quick") == 2
    farm.commit("quick")
    farm.passes(1.5 * USUAL_MS)
    # After twice that it is given the one that holds up the image, before any other
    assert farm.index("quick") == 0
    # And nobody is given it a third time
    farm.passes(30 * USUAL_MS)
    assert farm.index("another") == 3


def test_the_first_commit_wins_and_the_other_is_told(farm: Farm) -> None:
    job, _ = farm.slow_and_quick()
    farm.passes(5 * USUAL_MS)
    news = Wake(farm.client, keys.WAKE_WORKERS)
    news.wait(0.0, Stop())
    slow = farm.held["slow"]
    assert farm.index("quick") == 0
    assert farm.commit("quick") == "committed"
    # The slow worker hears of its own slice at once, and by its next heartbeat at the latest
    assert news.wait(60.0, Stop()) == {f"ended {job.id} {slow.entry}"}
    assert farm.worker("slow").heartbeat({}, (slow,)) == (slow,)
    # What it spent is counted once, as waste, however often it says so
    for _ in range(2):
        farm.worker("slow").hand_back(slow, 4.0, cause="it was cancelled")
    after = farm.jobs.get(job.id)
    assert (after.second_tries, after.wasted_s, after.machine_s) == (1, 4.0, 1.5 + 1.5 + 4.0)
    assert [(one.what, one.worker) for one in farm.jobs.log(job.id)] == [
        ("committed", "quick"),
        ("committed", "quick"),
        ("duplicate", "slow"),
    ]
    assert take_census(farm.client).tries["duplicate"] == 1
    # Nothing of it is leased any more, and fair shares know it
    assert farm.client.hget(keys.job(job.id), "leased") == "0"


def test_one_that_died_of_being_stopped_did_not_die_of_the_slice(farm: Farm) -> None:
    job, _ = farm.slow_and_quick()
    farm.passes(5 * USUAL_MS)
    assert farm.index("quick") == 0
    farm.commit("quick")
    assert farm.worker("slow").died(farm.held["slow"], "it did not answer", 4.0) == "lost"
    assert farm.jobs.get(job.id).wasted_s == 4.0
    assert [one.what for one in farm.jobs.log(job.id)] == ["committed", "committed", "duplicate"]


def test_where_the_late_one_is_first_after_all_the_second_try_is_waste(farm: Farm) -> None:
    job, _ = farm.slow_and_quick()
    farm.passes(5 * USUAL_MS)
    slow = farm.held["slow"]
    second = farm.lease("quick")
    assert second is not None
    assert second.tries == 2  # so that its partial has a name of its own
    assert farm.commit("slow", slow) == "committed"
    assert farm.commit("quick", second) == "duplicate"
    assert farm.jobs.ledger(job.id)[0]["worker"] == "slow"
    assert farm.jobs.get(job.id).wasted_s == 1.5


def test_who_has_nothing_else_to_do_is_given_it_too(farm: Farm) -> None:
    farm.slow_and_quick(slices=2)
    queue = farm.worker("quick")
    assert queue.lease(VARIANTS, None, in_turn=False) is None
    # It knows when to ask again, though nobody will wake it
    assert USUAL_MS / 2000 < queue.look_again_s <= 2 * USUAL_MS / 1000
    farm.passes(5 * USUAL_MS)
    assert farm.index("quick") == 0


def test_only_who_would_have_rendered_it_since(farm: Farm) -> None:
    farm.job(slices=12)
    assert [farm.index(name) for name in ("slow", "quick", "third")] == [0, 1, 2]
    farm.passes(USUAL_MS)
    farm.commit("quick")
    farm.passes(3 * USUAL_MS)
    farm.commit("slow")
    # Slice 2 holds up the image, and is late; but not yet as late as the slow one is by itself
    farm.passes(-1.5 * USUAL_MS)
    assert farm.index("slow") == 3
    # One that has never rendered the job would have to load it
    assert farm.index("new") == 4
    assert farm.index("quick") == 2


def test_who_is_known_to_be_slow_is_helped_at_once(farm: Farm) -> None:
    farm.job(slices=12)
    assert [farm.index(name) for name in ("slow", "quick", "third")] == [0, 1, 2]
    farm.passes(USUAL_MS)
    farm.commit("quick")
    farm.commit("third")
    farm.passes(5 * USUAL_MS)
    # The slow worker has one more; as soon as it holds up the image, a quick one is given it too
    farm.commit("slow")
    assert [farm.index("slow"), farm.index("quick")] == [3, 3]
    farm.commit("quick")
    # It is slow still, though it has not come to an end since
    assert [farm.index("slow"), farm.index("quick")] == [4, 4]
    # But not where it will be done sooner than another could be
    farm.commit("quick")
    assert farm.index("slow") == 5
    farm.passes(5.5 * USUAL_MS)
    assert farm.index("third") == 6
    # Nor for long after that
    farm.passes(3 * USUAL_MS)
    assert farm.index("third") == 5


def test_not_while_it_is_paused_or_after_its_end(farm: Farm) -> None:
    job, _ = farm.slow_and_quick(slices=2)
    farm.passes(30 * USUAL_MS)
    farm.jobs.pause(job.id)
    assert farm.index("quick") is None
    farm.jobs.resume(job.id)
    farm.jobs.cancel(job.id)
    assert farm.index("quick") is None
    assert farm.client.exists(keys.LATE) == 0
    for part in ("leases", "paces", "outrun"):
        assert farm.client.exists(keys.job(job.id, part)) == 0


def test_a_second_try_that_is_given_back_goes_to_the_next(farm: Farm) -> None:
    farm.slow_and_quick(slices=2)
    farm.passes(30 * USUAL_MS)
    assert farm.index("quick") == 0
    farm.worker("quick").hand_back(farm.held["quick"])
    assert farm.index("another") == 0
    assert farm.index("third") is None
    assert farm.commit("another") == "committed"
    assert farm.commit("slow") == "duplicate"


def test_an_index_that_says_what_is_not_so_is_made_afresh(farm: Farm) -> None:
    ended, _ = farm.job(slices=2)
    job, _ = farm.job(slices=2)
    # Given a job that ended without any script: the index still has it
    farm.client.hset(keys.job(ended.id), "state", "cancelled")
    assert farm.lease("one").job_id == job.id
    # And one that has gone altogether
    farm.client.delete(keys.job(job.id))
    assert farm.index("two") is None
