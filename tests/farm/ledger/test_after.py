"""Jobs that come after others: they wait until these have ended well, and never for ever."""

import pytest
import redis
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from plateau.farm.ledger.batches import Batches, Steer
from plateau.farm.ledger.continuation import Remains, changed_spec, lost_by
from plateau.farm.ledger.deletions import Deletions
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Ownerships
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.ledger.totals import take_census
from plateau.farm.model.errors import CannotFollow
from plateau.farm.model.job import Job
from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from tests.farm.ledger.test_waiting import quick as quick
from tests.support.farms.ledger_farm import own
from tests.support.long_tests import WANTED

WELL = (JobState.CONVERGED, JobState.EXHAUSTED)
BADLY = {JobState.FAILED: "failed", JobState.CANCELLED: "was cancelled"}


class Farm:
    """Jobs that end as they are told to."""

    def __init__(self, client: redis.Redis) -> None:
        self.client = client
        self.jobs = Jobs(client)
        self.owners = Ownerships(client, lease_s=60)

    def job(self, *after: str, name: str = "box", **spec: object) -> Job:
        """A job with two slices to lease, unless it waits."""
        asked = JobSpec(after=after, **spec)
        job = self.jobs.create(asked, name=name, scene_sha256="00").job
        owned = own(self.owners, job.id)
        self.owners.plan(owned, range(2))
        self.owners.disown([owned])
        return self.jobs.get(job.id)

    def ends(self, job: Job, state: JobState, *, finishes: bool = True) -> None:
        """The job ends, and its monitor writes its results and clears the rest."""
        if not self.jobs.get(job.id).state.ended:
            owned = own(self.owners, job.id)
            self.leased(job)
            self.owners.end(owned, state, "farm", "so it is")
            self.owners.disown([owned])
        if finishes:
            self.finishes(job)

    def finishes(self, job: Job) -> None:
        owned = own(self.owners, job.id)
        self.owners.conclude(owned, spp=25, results="", notes=())
        self.owners.finish(owned, keeps_sums=False)

    def leased(self, job: Job) -> None:
        """A job that is to be exhausted or to converge has been rendering before."""
        while self.jobs.get(job.id).state is JobState.QUEUED:
            assert self.given(), "the job waits"

    def given(self) -> str:
        """The job of which a worker is given a slice."""
        queue = SliceQueue(self.client, "w", 60)
        lease = queue.lease(("scalar_rgb",), None, in_turn=False)
        return "" if lease is None else lease.job_id

    def reason(self, job: Job) -> str:
        return self.jobs.get(job.id).reason


@pytest.fixture
def farm(client: redis.Redis) -> Farm:
    return Farm(client)


def no_gates(client: redis.Redis) -> bool:
    return not client.exists(keys.AWAITING) and not client.keys(f"{keys.PREFIX}job:*:after")


@pytest.mark.parametrize("state", WELL)
def test_a_job_waits_until_another_has_ended_well(farm: Farm, state: JobState) -> None:
    first = farm.job()
    second = farm.job(first.id)
    # It says what it waits for, no worker is given its slices, and nobody counts them as work
    assert (second.awaits, second.reason) == (1, f"waits for job box ({first.id})")
    assert [farm.given() for _ in range(3)] == [first.id, first.id, ""]
    assert take_census(farm.client).demand_for().waiting == 0
    # Not as soon as it has ended, but when its images are written
    farm.ends(first, state, finishes=False)
    assert farm.jobs.get(second.id).awaits == 1
    assert farm.given() == ""
    farm.finishes(first)
    second = farm.jobs.get(second.id)
    assert (second.awaits, second.reason) == (0, "waiting for a worker")
    assert farm.jobs.story(second.id)[-1].endswith("all that it waited for has ended well")
    assert farm.given() == second.id
    assert no_gates(farm.client)


@pytest.mark.parametrize(("state", "words"), BADLY.items())
def test_if_that_ends_badly_those_that_wait_are_cancelled(
    farm: Farm, state: JobState, words: str
) -> None:
    first, other = farm.job(), farm.job()
    second = farm.job(first.id, other.id, name="comp")
    third = farm.job(second.id, name="movie")
    assert farm.reason(second) == f"waits for job box ({first.id}), job box ({other.id})"
    farm.ends(first, state)
    why = f"job box ({first.id}), for which it waited, {words}"
    assert (farm.jobs.get(second.id).state, farm.reason(second)) == (JobState.CANCELLED, why)
    # And those that wait for them, once their monitor has seen it
    farm.finishes(second)
    assert farm.reason(third) == f"job comp ({second.id}), for which it waited, was cancelled"
    # What else they waited for goes its way
    farm.ends(other, JobState.CONVERGED)
    assert no_gates(farm.client)


def test_a_batch_is_waited_for_with_the_jobs_that_it_has(farm: Farm) -> None:
    frames = [farm.job(batch="walk") for _ in range(2)]
    movie = farm.job("walk")
    later = farm.job(batch="walk")
    assert farm.reason(movie) == "waits for batch walk"
    for frame in frames:
        assert farm.jobs.get(movie.id).awaits == 1
        farm.ends(frame, JobState.CONVERGED)
    assert farm.jobs.get(movie.id).awaits == 0
    # One that waits for its own batch waits for those before it
    last = farm.job("walk", batch="walk")
    farm.ends(later, JobState.FAILED)
    assert farm.reason(last) == f"job box ({later.id}), for which it waited, failed"
    assert no_gates(farm.client)


def test_one_bad_job_of_a_batch_is_enough(farm: Farm) -> None:
    first, second = farm.job(batch="walk"), farm.job(batch="walk")
    movie = farm.job("walk", "walk", second.id)
    assert farm.reason(movie) == f"waits for batch walk, job box ({second.id})"
    farm.ends(first, JobState.FAILED)
    assert farm.jobs.get(movie.id).state is JobState.CANCELLED
    with pytest.raises(CannotFollow, match=rf"job box \({first.id}\) failed, so nothing can"):
        farm.job("walk")
    # A deleted job is in no batch
    Deletions(farm.client).set(first.id, deleted=True)
    assert farm.job("walk").awaits == 1
    farm.ends(second, JobState.CONVERGED)
    assert no_gates(farm.client)


def test_what_has_ended_well_is_not_waited_for(farm: Farm) -> None:
    done = farm.job(batch="walk")
    farm.ends(done, JobState.EXHAUSTED)
    assert farm.job(done.id, "walk").awaits == 0
    Deletions(farm.client).set(done.id, deleted=True)
    with pytest.raises(CannotFollow, match=f"job {done.id} was deleted; restore it first"):
        farm.job(done.id)


def test_nothing_unknown_can_be_waited_for(farm: Farm) -> None:
    stored = farm.client.zcard(keys.JOBS)
    for name in ("0123456789ab", "walk", "sealed", "x" * 100, "a b:c"):
        with pytest.raises(CannotFollow, match=f"there is no job and no batch '{name}'"):
            farm.job(name)
    bad = farm.job()
    farm.ends(bad, JobState.CANCELLED)
    with pytest.raises(CannotFollow, match=r"was cancelled, so nothing can come after it"):
        farm.job(bad.id)
    assert farm.client.zcard(keys.JOBS) == stored + 1
    assert no_gates(farm.client)


def test_one_that_waits_can_be_cancelled_and_held(farm: Farm) -> None:
    first = farm.job()
    gone, held = farm.job(first.id), farm.job(first.id, batch="comps")
    farm.jobs.cancel(gone.id)
    Batches(farm.client).steer("comps", Steer.PAUSE)
    farm.ends(first, JobState.CONVERGED)
    assert farm.jobs.get(gone.id).state is JobState.CANCELLED
    assert farm.given() == ""
    Batches(farm.client).steer("comps", Steer.RESUME)
    assert farm.given() == held.id


def test_one_that_redis_has_lost_is_waited_for_no_more(farm: Farm) -> None:
    lost = farm.job(batch="walk")
    waiting = [farm.job(lost.id), farm.job("walk")]
    owned = own(farm.owners, lost.id)
    farm.client.delete(keys.job(lost.id))
    farm.owners.abandon(owned)
    for job in waiting:
        assert farm.jobs.get(job.id).state is JobState.CANCELLED
        assert farm.reason(job) == f"job ? ({lost.id}), for which it waited, is lost"
    assert no_gates(farm.client)


def test_one_that_continues_another_waits_for_nothing(farm: Farm) -> None:
    first = farm.job()
    job = farm.job(first.id)
    spec = JobSpec.model_validate(changed_spec(job.spec, {}))
    assert spec.after == ()
    remains = Remains(1, "", (), Plan.of(spec, 8, 8))
    assert lost_by(job, remains, job.spec) == "after"


HISTORIES = st.lists(
    st.tuples(st.booleans(), st.integers(0, 2**16), st.sampled_from(list(JobState)[3:])),
    min_size=5,
    max_size=25,
)


@settings(
    max_examples=1000 if WANTED else 20,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(HISTORIES)
def test_whatever_ends_however_nobody_waits_for_ever(
    quick: redis.Redis, events: list[tuple[bool, int, JobState]]
) -> None:
    client = quick
    client.flushall()
    farm, jobs = Farm(client), list[Job]()
    waited_for: dict[str, set[str]] = {}  # by job, those that it comes after

    for makes, number, end in events:
        unfinished = [job for job in jobs if client.sismember(keys.UNFINISHED, job.id)]
        if makes or not unfinished:
            batch = (None, "one", "two")[number % 3]
            chosen = [jobs[number // 3**at % len(jobs)] for at in range(number % 4) if jobs]
            names = [job.id if number % 5 else job.spec.batch or job.id for job in chosen]
            try:
                job = farm.job(*names, batch=batch)
            except CannotFollow:
                continue
            waited_for[job.id] = {
                one.id for one in jobs for name in names if name in (one.id, one.spec.batch)
            }
            jobs.append(job)
            continue
        job = unfinished[number % len(unfinished)]
        if farm.jobs.get(job.id).awaits:
            farm.jobs.cancel(job.id)
        farm.ends(job, end)
        # A job may be rendered if and only if all that it comes after has ended well
        now = {one.id: farm.jobs.get(one.id) for one in jobs}
        well = {one.id for one in now.values() if one.state in WELL and one.finished_at is not None}
        bad = {one.id for one in now.values() if one.state in BADLY and one.finished_at is not None}
        for one in now.values():
            if one.state is JobState.QUEUED:
                assert (one.awaits == 0) == (waited_for[one.id] <= well)
                assert not waited_for[one.id] & bad
    # When all that can be rendered has ended, nobody is left
    while unfinished := [job for job in jobs if client.sismember(keys.UNFINISHED, job.id)]:
        ready = [job for job in unfinished if not farm.jobs.get(job.id).awaits]
        assert ready
        farm.ends(ready[0], JobState.CONVERGED)
    assert no_gates(client)
