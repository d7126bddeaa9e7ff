"""Who may work together: the layout of Redis, and the protocol."""

import time
from collections.abc import Iterator

import pytest
import redis

from plateau.farm.ledger import schema
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.members import Membership, note_refused, refused_within
from plateau.farm.ledger.ownership import Ownerships
from plateau.farm.ledger.queue import Lease, SliceQueue
from plateau.farm.ledger.schema import check_schema
from plateau.farm.ledger.totals import MonitorWork
from plateau.farm.model import versions
from plateau.farm.model.errors import OldProcesses, Refused, WrongLayout
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.worker import Worker
from plateau.farm.redis import keys, scripts
from plateau.farm.redis.scripts import Scripts
from tests.farm.ledger.test_workers import about
from tests.support.redis.redis_commands import named


class Version:
    """A Plateau that speaks these protocols; its processes are made from it."""

    def __init__(self, client: redis.Redis, oldest: int, newest: int) -> None:
        self._client = client
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(versions, "OLDEST", oldest)
            patch.setattr(versions, "NEWEST", newest)
            patch.setattr(versions, "plateau", lambda: f"0.{newest}.0")
            scripts.text.cache_clear()
            # A script's text is made when its runner is: these keep what they speak
            self.worker = SliceQueue(client, f"worker-{newest}", 60)
            self.api = Membership(client, 60)
            self.monitor = MonitorWork(client, f"monitor-{newest}", 60)
        scripts.text.cache_clear()

    def lease(self) -> Lease | None:
        return self.worker.lease(("scalar_rgb",), None, in_turn=False)


@pytest.fixture(autouse=True)
def _own_texts() -> Iterator[None]:
    yield
    scripts.text.cache_clear()


def plan_slices(client: redis.Redis) -> None:
    """A job with something to render."""
    job = Jobs(client).create(JobSpec(), name="job", scene_sha256="00").job
    owners = Ownerships(client, 60)
    owned = owners.acquire(job.id)
    assert owned is not None
    owners.plan(owned, range(9))


class TestProtocol:
    def test_a_version_works_with_the_one_before_and_the_one_after(
        self, client: redis.Redis
    ) -> None:
        plan_slices(client)
        old, new, newer = (Version(client, newest - 1, newest) for newest in (2, 3, 4))
        # Given an old farm, a new worker may be first
        old.monitor.heartbeat(0)
        old.api.heartbeat()
        assert old.lease() is not None
        assert new.lease() is not None
        # If a new monitor joins, all speak what both do
        new.monitor.heartbeat(0)
        assert client.hmget(keys.PROTOCOL, "oldest", "newest") == ["2", "2"]
        assert old.lease() is not None
        assert new.lease() is not None
        with pytest.raises(Refused):
            newer.lease()
        # And when the old ones have gone, the next may come
        old.monitor.sign_off()
        old.api.sign_off()
        assert client.hmget(keys.PROTOCOL, "oldest", "newest") == ["2", "3"]
        assert newer.lease() is not None
        assert old.lease() is not None

    def test_a_worker_that_is_too_old_is_given_nothing(self, client: redis.Redis) -> None:
        plan_slices(client)
        Version(client, 3, 4).monitor.heartbeat(0)
        old = Version(client, 1, 2)
        words = (
            r"speak protocols 3 to 4 \(Plateau 0\.4\.0\), and this process speaks .* "
            r"It is too old: install Plateau 0\.4\.0 here"
        )
        for _ in range(2):
            with pytest.raises(Refused, match=words):
                old.lease()
        assert client.zcard(keys.LEASES) == 0

    def test_nor_is_one_that_is_too_new(self, client: redis.Redis) -> None:
        plan_slices(client)
        Version(client, 1, 1).monitor.heartbeat(0)
        with pytest.raises(Refused, match="It is too new: upgrade the farm's monitors and APIs"):
            Version(client, 2, 3).lease()

    def test_it_holds_while_no_monitor_lives(self, client: redis.Redis) -> None:
        plan_slices(client)
        new = Version(client, 3, 4)
        new.monitor.heartbeat(0)
        new.monitor.sign_off()
        with pytest.raises(Refused):
            Version(client, 1, 2).lease()

    @pytest.mark.parametrize("first", ["monitor", "api"])
    def test_monitors_and_apis_that_have_nothing_in_common_do_not_meet(
        self, client: redis.Redis, first: str
    ) -> None:
        old, new = Version(client, 1, 2), Version(client, 3, 4)
        old.monitor.heartbeat(0) if first == "monitor" else old.api.heartbeat()
        for heartbeat in (lambda: new.monitor.heartbeat(0), new.api.heartbeat):
            with pytest.raises(Refused):
                heartbeat()
        # The farm speaks on what it spoke
        assert client.hmget(keys.PROTOCOL, "oldest", "newest") == ["1", "2"]
        # Until those have gone
        old.monitor.sign_off() if first == "monitor" else old.api.sign_off()
        new.api.heartbeat()
        assert client.hmget(keys.PROTOCOL, "oldest", "newest") == ["3", "4"]

    def test_who_was_refused_is_known_for_a_while(self, client: redis.Redis) -> None:
        note_refused(client, "worker", Refused(3, 4, "0.4.0"))
        note_refused(client, "worker", Refused(4, 5, "0.5.0"))
        (one,) = refused_within(client, 60)
        assert one.role == "worker"
        assert "protocols 4 to 5" in one.why
        time.sleep(0.05)
        assert refused_within(client, 0.04) == []


class TestLayout:
    def test_a_process_that_runs_past_a_migration_can_do_nothing(self, client: redis.Redis) -> None:
        check_schema(client)
        plan_slices(client)
        slices, jobs = SliceQueue(client, "worker", 60), Jobs(client)
        lease = slices.lease(("scalar_rgb",), None, in_turn=False)
        assert lease is not None
        # If another one brings the layout forward
        client.set(keys.SCHEMA, versions.LAYOUT + 1)
        before = {key: client.dump(key) for key in client.keys("*")}
        # Then all that it could do is refused, in words
        for act in (
            lambda: slices.lease(("scalar_rgb",), None, in_turn=False),
            lambda: slices.heartbeat(about("worker"), (lease,)),
            lambda: slices.hand_back(lease),
            slices.leave,
            lambda: jobs.create(JobSpec(), name="new", scene_sha256="00"),
            lambda: jobs.cancel(lease.job_id),
            lambda: MonitorWork(client, "monitor", 60).heartbeat(0),
            Membership(client, 60).heartbeat,
        ):
            with pytest.raises(WrongLayout, match="a newer Plateau has migrated it; install"):
                act()
        # And nothing is changed
        assert {key: client.dump(key) for key in client.keys("*")} == before

    def test_every_command_looks_first(self, client: redis.Redis) -> None:
        client.set(keys.SCHEMA, "0")
        runner = Scripts(client)
        for name in scripts.commands():
            with pytest.raises(WrongLayout, match="start a monitor or an API of this Plateau"):
                runner.run(named(name))
        assert client.keys("*") == [keys.SCHEMA]

    def test_an_older_layout_waits_for_those_who_work_with_it(
        self, client: redis.Redis, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        # Given a farm of a made-up layout before, in which three processes live
        monkeypatch.setattr(schema, "_MIGRATIONS", {versions.LAYOUT - 1: ""})
        SliceQueue(client, "a-worker", 60).heartbeat(about("a-worker"), ())
        MonitorWork(client, "a-monitor", 60).heartbeat(0)
        api = Membership(client, 60)
        api.heartbeat()
        plan_slices(client)
        client.set(keys.SCHEMA, versions.LAYOUT - 1)
        # Then it is left as it is, and who they are is said
        with pytest.raises(OldProcesses, match="Stop them, then start this one again") as refused:
            check_schema(client)
        assert refused.value.who == ("worker a-worker", "monitor a-monitor", f"API {api.id}")
        assert client.get(keys.SCHEMA) == str(versions.LAYOUT - 1)
        # Until the last has gone
        client.delete(keys.WORKERS, keys.APIS)
        with pytest.raises(OldProcesses, match="monitor a-monitor"):
            check_schema(client)
        client.delete(keys.MONITORS)
        check_schema(client)
        assert client.get(keys.SCHEMA) == str(versions.LAYOUT)


def test_what_a_newer_worker_says_of_itself_is_read(client: redis.Redis) -> None:
    SliceQueue(client, "new", 60).heartbeat({**about("new"), "aura": "violet"}, ())
    (worker,) = Jobs(client).workers()
    assert worker == Worker(**about("new"), seen_at=worker.seen_at)  # type: ignore[arg-type]


def test_a_spec_with_a_field_of_a_newer_plateau_is_read(client: redis.Redis) -> None:
    job = Jobs(client).create(JobSpec(step=200), name="job", scene_sha256="00").job
    spec = client.hget(keys.job(job.id), "spec") or ""
    client.hset(keys.job(job.id), "spec", spec.replace("{", '{"shutter": 0.5, ', 1))
    assert Jobs(client).get(job.id).spec == JobSpec(step=200)
