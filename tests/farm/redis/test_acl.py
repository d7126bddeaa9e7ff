"""Each kind of process has a user in Redis that can do its work, and nothing beside it."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import redis

import plateau.farm.ledger.queue
from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.api_keys import ApiKeys, KeyLimits, Role
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Ownerships
from plateau.farm.ledger.pairing import check_pair
from plateau.farm.ledger.queue import Lease, SliceQueue
from plateau.farm.ledger.schema import check_schema
from plateau.farm.model.errors import NotPermitted, StoreUnavailable
from plateau.farm.model.place_names import DEFAULT_POOL
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import MAX_TRIES, JobState
from plateau.farm.process.waits import Stop
from plateau.farm.redis import keys
from plateau.farm.redis.acl import QUEUE_PARTS, acl_file
from plateau.farm.redis.commands.command import Command
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from plateau.farm.redis.scripts import Scripts
from plateau.farm.redis.wake import Wake
from tests.support.farms import ledger_farm
from tests.support.farms.ledger_farm import VARIANTS, lease, own, runs_out
from tests.support.farms.receiver import SECRET
from tests.support.redis.redis_commands import commands, named
from tests.support.redis.redis_users import LEASE_S, Login, monitor_comes, users

LIMITS = KeyLimits(upload_bytes=1, open_jobs=10)
NOTICE = {"url": "https://studio.example/hook", "secret": SECRET}


@pytest.fixture
def login(client: redis.Redis, redis_url: str) -> Iterator[Login]:
    """Opens a connection as one of the users; none of them may have been refused anything."""
    with users(client, redis_url) as login:
        yield login


def commit(worker: SliceQueue, held: Lease, blob: str = "") -> str:
    return ledger_farm.commit(worker, held, said="words", blob=blob or f"partial-{held.index}")


def about(name: str) -> dict[str, object]:
    return {"id": name, "variants": VARIANTS, "pool": DEFAULT_POOL, "tags": ()}


def test_a_worker_can_do_all_that_workers_do(client: redis.Redis, login: Login) -> None:
    # Given a farm whose processes are each a user of its own
    monitor_comes(login)
    jobs, owners = Jobs(login("api")), Ownerships(login("monitor"), lease_s=15)
    key, _ = ApiKeys(login("admin")).create("anna", Role.SUBMITTER, LIMITS)

    def job(**spec: object) -> str:
        whole = JobSpec.model_validate({"notice": NOTICE, **spec})
        made = jobs.create(whole, name="box", scene_sha256="00", owner=key.id).job
        owners.plan(own(owners, made.id), range(4))
        return made.id

    worker = SliceQueue(login("worker"), "w", LEASE_S)
    other = SliceQueue(login("worker"), "v", LEASE_S)
    hints = Wake(login("worker"), keys.wake_worker("w"))
    # When it waits for work, is woken for it, and renders what is planned
    worker.heartbeat(about("w"), ())
    other.heartbeat(about("v"), ())
    assert worker.lease(VARIANTS, None, in_turn=False) is None
    assert not hints.wait(0.1, Stop())
    first = job(batch="walk")
    assert hints.wait(5, Stop()) == {"planned"}
    held = lease(worker)
    assert worker.heartbeat(about("w"), (held,)) == ()
    assert worker.glimpse(held, blobs.glimpse(first, "w"))
    assert commit(worker, held) == "committed"
    assert commit(worker, held) == "committed"
    assert commit(worker, held, "another") == "duplicate"
    # And gives some back, lets one run out, and finds one that it has tried already
    worker.hand_back(lease(worker, first, in_turn=True), 0.1, cause="it stops", said="words")
    lost = lease(worker)
    runs_out(client, lost)
    taken = lease(other)
    assert taken.index == lost.index
    assert commit(worker, lost) == "committed"
    assert worker.ended(first) is False
    # And one kills every worker, so that its job fails; the first is then left out of it
    second = job(priority=5)
    for one in (worker, *[other] * (MAX_TRIES - 1)):
        one.died(lease(one), "it was killed", 0.1, "words")
    assert jobs.get(second).state is JobState.FAILED
    third = job(priority=9)
    worker.fail(lease(worker), "no such plugin", 0.1, "words")
    assert jobs.get(third).state is JobState.FAILED
    worker.leave()
    # Then nothing was refused
    assert client.acl_log() == []
    assert client.scard(f"plateau:key:{key.id}:open") == 1


JOB = "0123456789ab"
WITHHELD = [
    *(("zrange", keys.NOTICES, 0, -1), ("zadd", f"{keys.NOTICES}:ops", 0, JOB)),
    *(("hgetall", keys.job(JOB, "sealed")), ("hset", keys.job(JOB, "sealed"), "owner", JOB)),
    *(("hgetall", keys.API_KEYS), ("hset", keys.API_KEYS, JOB, "{}"), ("hgetall", "plateau:keys")),
    ("zrange", keys.jobs_of_key(JOB), 0, -1),
    *(("set", keys.job(JOB, "owner"), "9"), ("hincrby", keys.job(JOB, "sealed"), "fence", 1)),
    ("xadd", keys.job(JOB, "curve"), "*", "point", "{}"),
    *(("zrange", keys.BATCHES, 0, -1), ("zadd", keys.batch("walk"), 1, JOB)),
    *(("hgetall", keys.SCENES), ("get", "plateau:idempotency:x"), ("zrange", keys.JOBS, 0, -1)),
    *(("zrange", keys.MONITORS, 0, -1), ("hgetall", keys.monitor("m"))),
    *(("get", "another application's"), ("set", "another application's", "x")),
    # Nor may it look about, or run the server
    *(("keys", "*"), ("randomkey",), ("dbsize",), ("info",), ("monitor",)),
    *(("flushall",), ("flushdb",), ("config", "get", "*"), ("config", "set", "dir", "/tmp")),
    *(("acl", "list"), ("acl", "setuser", "plateau-worker", "allkeys"), ("save",), ("shutdown",)),
    *(("script", "flush"), ("script", "kill"), ("client", "list")),
    *(("script", "load", "while true do end"), ("client", "kill", "type", "normal")),
    *(("replicaof", "no", "one"), ("eval", "return 1", 0), ("migrate", "h", 1, "k", 0, 1)),
    *(("rename", keys.HEARD, keys.API_KEYS), ("copy", keys.API_KEYS, keys.HEARD), ("swapdb", 0, 1)),
]


@pytest.mark.parametrize("act", WITHHELD, ids=lambda act: " ".join(map(str, act)))
def test_a_worker_is_refused_all_else(login: Login, act: tuple[str, ...]) -> None:
    with pytest.raises(NotPermitted, match="plateau redis-acl"):
        login("worker").execute_command(*act)


@pytest.mark.parametrize("act", ["SUBSCRIBE", "PUBLISH"])
def test_a_worker_hears_and_says_nothing_on_other_channels(login: Login, act: str) -> None:
    with pytest.raises(NotPermitted):
        login("worker").execute_command(act, "news", *(["x"] if act == "PUBLISH" else []))


def test_a_workers_scripts_reach_no_further_than_it_does(login: Login) -> None:
    worker, admin = login("worker"), login("admin")
    script = admin.script_load(f"return redis.call('HGETALL', '{keys.API_KEYS}')")
    with pytest.raises(NotPermitted):
        worker.evalsha(script, 0)


def test_a_worker_runs_no_command_that_is_not_for_workers(
    client: redis.Redis, login: Login
) -> None:
    monitor_comes(login)
    jobs, worker = Jobs(login("api")), Scripts(login("worker"))
    job = jobs.create(JobSpec(notice=NOTICE), name="box", scene_sha256="00").job
    before = {key: client.dump(key) for key in client.keys("*")}
    # Though it may run the script in which they all are, and whatever it says with them
    for command in commands("farm"):
        with pytest.raises(NotPermitted):
            worker.run(named(command))
        with pytest.raises(NotPermitted):
            worker.run(named(command, job=job.id, target="cancelled", reason="it says so"))
    with pytest.raises(redis.exceptions.ResponseError, match="has no command"):
        Scripts(login("monitor")).run(named("no such command"))
    assert {key: client.dump(key) for key in client.keys("*")} == before


#: Nobody runs the server; only the administrator ends what hangs; and a monitor has nothing to do
#: with who may use the API.
RUNS_THE_SERVER = [
    *(("flushall",), ("keys", "*"), ("config", "set", "dir", "/"), ("acl", "list")),
    *(("replicaof", "h", 1), ("set", "theirs", "x")),
]
ENDS_WHAT_HANGS = [("shutdown",), ("client", "list"), ("acl", "log")]
OF_THE_API = [("hset", keys.API_KEYS, JOB, "{}"), ("get", "idempotency:x")]


@pytest.mark.parametrize(
    ("role", "acts"),
    [
        ("monitor", [*RUNS_THE_SERVER, *ENDS_WHAT_HANGS, *OF_THE_API]),
        ("api", [*RUNS_THE_SERVER, *ENDS_WHAT_HANGS]),
        ("admin", RUNS_THE_SERVER),
    ],
)
def test_others_are_refused_what_is_not_for_them(
    login: Login, role: str, acts: list[tuple[str, ...]]
) -> None:
    one = login(role)
    for act in acts:
        with pytest.raises(NotPermitted):
            one.execute_command(*act)


@pytest.mark.parametrize("role", ["worker", "monitor", "api", "admin"])
def test_nobody_debugs_the_server(login: Login, role: str) -> None:
    # Since Redis 7 it is refused to everybody, before anyone's rights are looked at
    with pytest.raises(
        (NotPermitted, redis.exceptions.ResponseError), match=r"has no permissions|not allowed"
    ):
        login(role).execute_command("debug", "sleep", 0)


def test_a_worker_waits_for_who_may_lay_out_redis(login: Login, store: Blobs) -> None:
    worker, monitor = login("worker"), login("monitor")
    with pytest.raises(StoreUnavailable, match="start a monitor or an API"):
        check_schema(worker)
    check_schema(monitor)
    check_schema(worker)
    with pytest.raises(StoreUnavailable, match="start a monitor or an API"):
        check_pair(worker, store)
    check_pair(monitor, store)
    check_pair(worker, store)


def test_a_worker_waits_for_who_may_load_its_scripts(client: redis.Redis, login: Login) -> None:
    # Given a farm without a monitor or an API
    check_schema(login("monitor"))
    worker = SliceQueue(login("worker"), "w", LEASE_S)

    def waits() -> None:
        with pytest.raises(StoreUnavailable, match="waits for a monitor or an API of this version"):
            worker.heartbeat(about("w"), ())

    waits()
    # When a monitor comes, it goes on
    monitor = monitor_comes(login)
    assert worker.heartbeat(about("w"), ()) == ()
    # And so it does after Redis has forgotten all scripts, as where it starts again
    client.script_flush()
    waits()
    monitor.heartbeat(0)
    assert worker.heartbeat(about("w"), ()) == ()


def test_a_wrong_password_is_not_repeated(login: Login, embedded_redis: EmbeddedRedis) -> None:
    path = embedded_redis.url.removeprefix("unix://")
    with pytest.raises(StoreUnavailable) as refusal:
        connect(f"unix://plateau-worker:guessed@{path}").ping()
    assert "guessed" not in str(refusal.value)


def test_the_queue_asks_for_the_commands_of_workers_alone() -> None:
    known = vars(plateau.farm.ledger.queue)
    kinds = [*known.values(), *vars(known["commands"]).values()]
    asked = {kind for kind in kinds if isinstance(kind, type) and issubclass(kind, Command)}
    ran = {kind.lua_name() for kind in asked if not kind.__name__.endswith("Command")}
    assert ran == commands("workers")
    assert set(QUEUE_PARTS) <= set(keys.JOB_PARTS)


def test_the_file_in_the_repository_is_what_the_command_prints() -> None:
    deployed = Path(__file__).parents[3] / "deploy" / "redis" / "users.acl"
    assert deployed.read_text() == acl_file({}), "plateau redis-acl > deploy/redis/users.acl"


def test_who_met_an_old_file_waits_until_it_is_mended(client: redis.Redis, login: Login) -> None:
    # Given a worker whose user lacks what its scripts need by now
    monitor_comes(login)
    worker = SliceQueue(login("worker"), "w", LEASE_S)
    client.execute_command("ACL", "SETUSER", "plateau-worker", "-publish", "-zadd")
    # Then that is said, as what it waits for
    with pytest.raises(StoreUnavailable, match="ACL file that `plateau redis-acl`"):
        worker.heartbeat(about("w"), ())
    # And when it is mended it goes on
    client.execute_command("ACL", "SETUSER", "plateau-worker", "+publish", "+zadd")
    assert worker.heartbeat(about("w"), ()) == ()
    client.acl_log_reset()
