"""What a worker in wrong hands leaves in Redis keeps no script busy for good, and opens nothing."""

from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest
import redis

from plateau.farm.ledger.api_keys import ApiKeys, KeyLimits, Role
from plateau.farm.ledger.batches import Batches, Steer
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.outbox import Outbox
from plateau.farm.ledger.ownership import Ownership, Ownerships
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.model.errors import NotPermitted, StoreUnavailable
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.redis.commands.jobs import Continue, NewJob
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from plateau.farm.redis.scripts import Scripts
from tests.support import FRAMES
from tests.support.farms.ledger_farm import lease_scalar, own
from tests.support.redis.lost_answers import ABOUT, NOTICE, WORKER, commit
from tests.support.redis.redis_users import LEASE_S, Login, monitor_comes, users
from tests.support.until import until

#: Adding one to these changes nothing.
NO_MORE = ["9007199254740992", "-9007199254740992", "1e300", "-1e300", "inf", "-inf", "nan", "x"]
#: Such a text takes hours where a pattern is tried at each of its characters up to its end.
LONG = "a" * 2_000_000


@pytest.fixture(scope="module")
def embedded_redis(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmbeddedRedis]:
    """A server of their own: it may hang."""
    server = EmbeddedRedis(tmp_path_factory.mktemp("redis"))
    yield server
    server.process.kill()
    server.stop()


@pytest.fixture
def login(client: redis.Redis, redis_url: str) -> Iterator[Login]:
    with users(client, redis_url) as login:
        monitor_comes(login)
        yield login


@pytest.fixture
def job(login: Login) -> Ownership:
    """A job with slices to be rendered, and a notice."""
    spec = JobSpec(**FRAMES, step=100, slice_spp=50, notice=NOTICE)
    made = Jobs(login("api")).create(spec, name="box", scene_sha256="00").job
    owners = Ownerships(login("monitor"), 60)
    owned = own(owners, made.id)
    owners.plan(owned, range(8))
    return owned


@pytest.mark.parametrize("number", NO_MORE)
def test_a_prefix_that_cannot_grow_ends_nevertheless(
    login: Login, job: Ownership, number: str
) -> None:
    worker = login("worker")
    queue = SliceQueue(worker, WORKER, LEASE_S)
    first = lease_scalar(queue)
    # Given a prefix of the image that no script writes, with its slice in the ledger
    worker.hset(keys.job(job.job_id), "prefix", number)
    for spelt in (number, "9.007199254741e+15", "-9.007199254741e+15", "1e+300", "-1e+300"):
        worker.hset(keys.job(job.job_id, "ledger"), spelt, "{}")
    # Then a commit is answered, and the first slice that is missing holds the image up
    assert commit(queue, first) == "committed"
    assert worker.hget(keys.job(job.job_id), "prefix") == "1"


@pytest.mark.parametrize("number", [*NO_MORE, "1e12"])
def test_a_job_with_a_wrong_count_of_slices_can_be_gone_on_with(
    login: Login, job: Ownership, number: str
) -> None:
    worker, owners = login("worker"), Ownerships(login("monitor"), 60)
    queue = SliceQueue(worker, WORKER, LEASE_S)
    for blob in ("one", "two"):
        lease = lease_scalar(queue)
        assert commit(queue, lease, blob) == "committed"
    owners.end(job, JobState.CONVERGED, "rule", "levelled off", None, "")
    owners.finish(job, keeps_sums=False)
    worker.hset(keys.job(job.job_id), "planned", number)
    fields = {"name": "box", "spec": "{}", "scene_sha256": "00", "slice_spp": 50, "committed": 0}
    fields |= {"asked_variant": "auto", "planned": 0, "issued": 0, "ready": 0, "leased": 0}
    goes_on = Continue(
        job=NewJob("b" * 12, fields),
        old=job.job_id,
        slices=1,
        checkpoint="",
        judged_spp=50,
        samples=50,
        rounds=(),
        idempotency="",
        digest="",
        priority=0,
    )
    assert Scripts(login("api")).run(goes_on).outcome == "created"
    assert login("api").hkeys(keys.job("b" * 12, "ledger")) == ["0"]


Spoil = Callable[[redis.Redis, str], object]


@pytest.mark.parametrize(
    "spoil",
    [
        lambda worker, job: worker.hset(keys.worker(WORKER), "blamed", LONG),
        lambda worker, job: worker.hset(keys.job(job, "leases"), 0, f"1 2 {LONG} 4 5"),
        lambda worker, job: worker.zadd(f"{keys.WAITING}:0 auto default", {f"0 {LONG} ": -1}),
        lambda worker, job: worker.hset(keys.job(job), "took", LONG),
    ],
    ids=["blamed", "leases", "waiting", "took"],
)
def test_no_pattern_is_tried_on_a_text_without_end(
    client: redis.Redis, login: Login, job: Ownership, spoil: Spoil
) -> None:
    # Given a text in Redis that no script writes
    spoil(login("worker"), job.job_id)
    # Then each of a worker's steps is answered, if with an error
    queue = SliceQueue(login("worker"), WORKER, LEASE_S)
    for step in (
        lambda: queue.heartbeat(ABOUT, ()),
        lambda: commit(queue, lease_scalar(queue)),
        lambda: lease_scalar(queue),
    ):
        with suppress(redis.exceptions.ResponseError, NotPermitted, AssertionError):
            step()
    assert client.ping()


def test_the_administrator_ends_a_script_that_does_not_end(
    embedded_redis: EmbeddedRedis, client: redis.Redis, login: Login, job: Ownership
) -> None:
    # Given a script that never ends, which has written, so that Redis lets nobody kill it
    client.config_set("lua-time-limit", 100)
    admin, stuck = login("admin"), connect(embedded_redis.url, answer_s=0.5)
    script = "redis.call('SET', 'plateau:x', 1) while true do end"
    with pytest.raises(StoreUnavailable, match="Timeout"):
        stuck.eval(script, 0)
    with pytest.raises(StoreUnavailable, match="BUSY"):
        until(lambda: login("monitor").get(keys.SCHEMA) == "never")
    with pytest.raises(redis.exceptions.ResponseError, match="UNKILLABLE"):
        admin.script_kill()
    # When the administrator shuts the server down
    with suppress(StoreUnavailable):  # it is gone before it answers
        admin.shutdown(nosave=True)
    embedded_redis.process.wait(120)
    # Then it can be started again, with all that was answered
    embedded_redis.start()
    assert Jobs(client).get(job.job_id).name == "box"
    assert not client.exists("plateau:x")
    stuck.close()


def test_whose_a_job_is_stays_as_it_is(login: Login) -> None:
    # Given a job of Anna's, one of nobody's, and a worker that is Bert's
    limits = KeyLimits()
    api_keys = ApiKeys(login("admin"))
    anna, bert = (api_keys.create(name, Role.SUBMITTER, limits)[0].id for name in ("anna", "bert"))
    jobs = Jobs(login("api"))
    spec = JobSpec(**FRAMES, step=100, slice_spp=50, batch="walk", notice=NOTICE)
    annas, nobodys = (
        jobs.create(spec, name="box", scene_sha256="00", owner=owner).job.id for owner in (anna, "")
    )
    # When the worker writes all that it may write of them
    for job_id in (annas, nobodys):
        theirs = {"owner": bert, "owner_name": "bert", "party": bert}
        login("worker").hset(keys.job(job_id), mapping=theirs)
        with pytest.raises(NotPermitted):
            login("worker").hset(keys.job(job_id, "sealed"), mapping=theirs)
    # Then nothing is Bert's that was not, by whatever way one asks
    assert [jobs.get(job_id).owner_name for job_id in (annas, nobodys)] == ["anna", None]
    assert [job.owner for job in jobs.search()[0]] == [None, anna]
    assert [ApiKeys(login("api")).owner_of(job_id) for job_id in (annas, nobodys)] == [anna, ""]
    assert jobs.search(owner=bert, batch="walk") == jobs.search(owner=bert) == ([], None)
    steered = Batches(login("api")).steer("walk", Steer.CANCEL, may_touch=lambda who: who == bert)
    assert {one.why_not for one in steered} == {"it belongs to another API key"}
    owners = Ownerships(login("monitor"), 60)
    for job_id in (annas, nobodys):
        jobs.cancel(job_id)
        owners.finish(own(owners, job_id), keeps_sums=False)
    notices = [Outbox(login("monitor")).take(60) for _ in range(2)]
    assert {one and one.job.owner_name for one in notices} == {"anna", None}
