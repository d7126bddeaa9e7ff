"""Pools, tags and variants: who may render a job, who is woken for it, and what a job waits for."""

import pytest
import redis
from pydantic import ValidationError

from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.ledger.totals import take_census
from plateau.farm.ledger.workers import Workers
from plateau.farm.model.errors import InvalidSpec, TooManyNeeds
from plateau.farm.model.fit import Crew, waits_for
from plateau.farm.model.job import Job
from plateau.farm.model.spec import BatchSpec, JobSpec
from plateau.farm.process.settings import Settings
from plateau.farm.process.waits import Stop
from plateau.farm.redis import keys
from plateau.farm.redis.wake import Wake
from tests.support.farms.ledger_farm import LedgerFarm, lease, live_on
from tests.support.farms.ledger_farm import about as described

LLVM = ("llvm_ad_rgb", "scalar_rgb")


class Farm(LedgerFarm):
    """Workers of any pool and tags."""

    def __init__(self, client: redis.Redis) -> None:
        super().__init__(client)
        self.workers = Workers(client)

    def made(self, **spec: object) -> Job:
        return self.job(**spec)[0]

    def queue(self, name: str, *tags: str, pool: str = "default") -> SliceQueue:
        return SliceQueue(self.client, name, 60, pool=pool, tags=tags)

    def given(self, *tags: str, pool: str = "default", variants: tuple[str, ...] = LLVM) -> str:
        """The job of which such a worker is given a slice."""
        found = self.queue("w", *tags, pool=pool).lease(variants, None, in_turn=False)
        return "" if found is None else found.job_id

    def lives(self, name: str, *tags: str, pool: str = "default", **about: object) -> None:
        about = {**described(name), "variants": LLVM, "pool": pool, "tags": tags, **about}
        self.queue(name).heartbeat(about, ())

    def words(self, job: Job) -> str | None:
        return waits_for(self.jobs.get(job.id), Crew(Workers(self.client).living()))

    def dies(self, name: str, job: Job, *tags: str) -> None:
        """A slice of the job dies on this worker."""
        queue = self.queue(name, *tags)
        held = lease(queue, job.id, in_turn=True, variants=LLVM)
        assert held.job_id == job.id
        assert queue.died(held, "a crash", 1.0) == "put back"

    def relents(self, name: str) -> None:
        """Time passes, for which the worker was left out of jobs."""
        left_out = self.client.hget(keys.worker(name), "left_out").split()
        left_out[1::2] = "1" * len(left_out[::2])
        self.client.hset(keys.worker(name), "left_out", " ".join(left_out))


@pytest.fixture
def farm(client: redis.Redis) -> Farm:
    return Farm(client)


class TestLeftOut:
    """A worker on which a slice of a job dies leaves its slices to others for a while."""

    def test_it_is_not_woken_and_others_are(self, farm: Farm) -> None:
        stop, wakes = Stop(), {}
        for name in ("one", "two"):
            farm.lives(name)
        job = farm.made()
        farm.dies("one", job)
        farm.jobs.pause(job.id)
        for name in ("one", "two"):
            wakes[name] = Wake(farm.client, keys.wake_worker(name))
            wakes[name].wait(0.0, stop)
            assert farm.queue(name).lease(LLVM, None, in_turn=False) is None
        farm.jobs.resume(job.id)
        assert {name for name, wake in wakes.items() if wake.wait(0.5, stop)} == {"two"}
        # It is still idle, and woken for another job
        farm.made()
        assert wakes["one"].wait(5.0, stop)

    @pytest.mark.parametrize("other", ["nobody", "drained", "in trouble", "unfit", "left out"])
    def test_not_where_no_other_can_render_the_job(self, farm: Farm, other: str) -> None:
        farm.lives("one", "gpu")
        job = farm.made(requires=("gpu",))
        if other != "nobody":
            tags = () if other == "unfit" else ("gpu",)
            farm.lives("two", *tags, trouble="no disk" if other == "in trouble" else None)
        if other == "drained":
            farm.workers.drain("two")
        if other == "left out":
            farm.dies("two", job, "gpu")
        farm.dies("one", job, "gpu")
        left_out = {one.id: one.left_out_of for one in Workers(farm.client).living()}
        assert left_out["one"] == ()
        assert farm.queue("one", "gpu").lease(LLVM, None, in_turn=False) is not None

    def test_a_job_of_which_all_workers_are_left_out_says_so(self, farm: Farm) -> None:
        job = farm.made(requires=("gpu",))
        farm.lives("west", "gpu")
        lease = farm.queue("west", "gpu").lease(LLVM, None, in_turn=False)
        farm.queue("west").hand_back(lease, cause="its files differ", leaves_out=True)
        words = "waits for a worker with tags gpu that is not left out of it: there is none that "
        assert (farm.words(job), take_census(farm.client).unserved) == (
            words + "takes work",
            (job.id,),
        )
        farm.lives("east", "gpu")
        assert (farm.words(job), take_census(farm.client).unserved) == (None, ())
        # And a worker says of which jobs it is left out
        left_out = {one.id: one.left_out_of for one in Workers(farm.client).living()}
        assert left_out == {"west": (job.id,), "east": ()}
        farm.relents("west")
        assert {one.left_out_of for one in Workers(farm.client).living()} == {()}
        # One that says nonsense hides no other
        live_on(farm.client, "west")
        farm.client.hset(keys.worker("east"), "about", "{}")
        assert [one.id for one in Workers(farm.client).living()] == ["west"]


class TestWords:
    """A job for which no worker lives says what it waits for."""

    def test_not_where_it_is_not_to_be_rendered(self, farm: Farm) -> None:
        job = farm.made()
        farm.jobs.cancel(job.id)
        assert farm.words(job) is None
        assert take_census(farm.client).unserved == ()

    @pytest.mark.parametrize("trouble", ["the disk is full", None])
    def test_who_takes_no_work_does_not_count(self, farm: Farm, trouble: str | None) -> None:
        job = farm.made()
        farm.lives("w", trouble=trouble)
        if trouble is None:
            Workers(farm.client).drain("w")
        assert farm.words(job) is not None


class TestNames:
    """Names of pools and tags are short and plain, since scripts compare them as text."""

    @pytest.mark.parametrize("name", ["", "a b", "a,b", "a:b", "-a", "ä", "x" * 41])
    def test_others_are_refused(self, name: str) -> None:
        with pytest.raises(InvalidSpec, match=r"^pool: must"):
            JobSpec(pool=name)
        with pytest.raises(InvalidSpec):
            JobSpec(requires=(name,))
        with pytest.raises(ValidationError):
            Settings(pool=name)

    def test_tags_are_a_set(self) -> None:
        assert JobSpec(requires=("b", "a", "b")).requires == ("a", "b")

    def test_settings_have_commas(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("PLATEAU_TAGS", "highmem, gpu")
        monkeypatch.setenv("PLATEAU_POOL", "night")
        settings = Settings()
        assert (settings.pool, settings.tags) == ("night", ("gpu", "highmem"))

    def test_a_batch_passes_them_on(self) -> None:
        batch = BatchSpec(pool="night", requires=("gpu",), parameters=({"a": 1}, {"a": 2}))
        jobs = batch.job_specs("b")
        assert [(job.pool, job.requires) for job in jobs] == [("night", ("gpu",))] * 2


def test_open_jobs_need_a_limited_number_of_different_things(farm: Farm) -> None:
    first = farm.made(pool="p0")
    for number in range(1, keys.MOST_NEEDS):
        farm.made(pool=f"p{number}")
    with pytest.raises(TooManyNeeds, match="64 different"):
        farm.made(requires=("gpu",))
    # Another of a need that there is, is taken; and a new one when one has gone with its jobs
    again = farm.made(pool="p0")
    farm.jobs.cancel(first.id)
    with pytest.raises(TooManyNeeds):
        farm.made(requires=("gpu",))
    farm.jobs.cancel(again.id)
    job = farm.made(requires=("gpu",))
    assert farm.given("gpu") == job.id
