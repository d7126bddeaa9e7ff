"""API keys: shown once, found by what was shown, counted, rotated, revoked."""

import contextlib
import hashlib
import json
import threading

import pytest
import redis

from plateau.farm.ledger.api_keys import ApiKey, ApiKeys, KeyLimits, Role
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.errors import UnknownKey
from plateau.farm.model.spec import JobSpec
from plateau.farm.redis import keys as names
from plateau.farm.redis.link import connect


class TestAKey:
    def test_is_not_stored(self, keys: ApiKeys, client: redis.Redis) -> None:
        made, shown = keys.create("me", Role.ADMIN, KeyLimits())
        secret = shown.rpartition("_")[2]
        assert made.sha256 not in repr(made)
        for key in client.keys("*"):
            assert secret not in str(client.dump(key))
        [stored] = client.hvals(names.API_KEYS)
        assert secret not in stored
        assert json.loads(stored)["sha256"] == hashlib.sha256(secret.encode()).hexdigest()

    @pytest.mark.parametrize(
        "forged",
        [
            "",
            "plateau",
            "plateau_{id}_",
            "plateau_{id}_{other}",
            "plateau_{id}_{secret}0",
            "plateau_{id}_{secret}\n",
            " plateau_{id}_{secret}",
            "PLATEAU_{id}_{secret}",
            "plateau_{wrong}_{secret}",
            "plateau_{id}_{upper}",
            "{secret}",
        ],
    )
    def test_is_not_found_by_anything_else(self, keys: ApiKeys, forged: str) -> None:
        made, shown = keys.create("me", Role.SUBMITTER, KeyLimits())
        _, other = keys.create("you", Role.SUBMITTER, KeyLimits())
        secret = shown.rpartition("_")[2]
        parts = {"id": made.id, "secret": secret, "other": other.rpartition("_")[2]}
        parts |= {"wrong": "0" * 12, "upper": secret.upper()}
        assert keys.find(forged.format(**parts)) is None

    def test_that_was_revoked_opens_nothing_and_stays(self, keys: ApiKeys) -> None:
        made, shown = keys.create("me", Role.SUBMITTER, KeyLimits())
        revoked = keys.revoke(made.id)
        assert revoked.revoked_at is not None
        assert keys.find(shown) is None
        assert keys.any_made()
        assert [key.name for key in keys.all()] == ["me"]
        # Revoking it again is harmless, and does not change since when
        assert keys.revoke(made.id) == revoked
        with pytest.raises(UnknownKey, match="was revoked; make another"):
            keys.rotate(made.id)

    def test_can_have_another_secret(self, keys: ApiKeys) -> None:
        made, before = keys.create("me", Role.SUBMITTER, KeyLimits())
        same, after = keys.rotate(made.id)
        assert (same.id, same.created_at) == (made.id, made.created_at)
        assert keys.find(before) is None
        assert keys.find(after) == same

    def test_that_was_made_elsewhere_is_taken_once(self, keys: ApiKeys) -> None:
        shown = f"plateau_0123456789ab_{'5' * 64}"
        taken = keys.admit(shown, "scaler", Role.VIEWER, KeyLimits())
        assert keys.find(shown) == taken
        assert keys.admit(shown, "scaler", Role.VIEWER, KeyLimits()) == taken
        assert keys.all() == [taken]
        # If its secret, or what it may do, was changed where it was made
        again = f"plateau_0123456789ab_{'6' * 64}"
        changed = keys.admit(again, "scaler", Role.ADMIN, KeyLimits())
        assert keys.find(shown) is None
        assert keys.find(again) == changed
        assert (changed.role, changed.created_at) == (Role.ADMIN, taken.created_at)
        # And one that was revoked stays so
        keys.revoke(taken.id)
        with pytest.raises(UnknownKey, match="was revoked; make another"):
            keys.admit(again, "scaler", Role.ADMIN, KeyLimits())
        with pytest.raises(UnknownKey, match="a key is plateau_, 12 hexadecimal digits"):
            keys.admit("hunter2", "scaler", Role.ADMIN, KeyLimits())

    def test_stays_revoked_whoever_changes_it_at_the_same_time(
        self, keys: ApiKeys, client: redis.Redis
    ) -> None:
        made, _ = keys.create("me", Role.SUBMITTER, KeyLimits())
        url = f"unix://{client.connection_pool.connection_kwargs['path']}"

        rotated = threading.Semaphore(0)

        def rotate() -> None:
            others = ApiKeys(connect(url, 120.0))
            with contextlib.suppress(UnknownKey):
                while True:  # until it is revoked
                    others.rotate(made.id)
                    rotated.release()

        threads = [threading.Thread(target=rotate) for _ in range(4)]
        for thread in threads:
            thread.start()
        for _ in range(20):
            assert rotated.acquire(timeout=60)
        keys.revoke(made.id)
        for thread in threads:
            thread.join(60)
            assert not thread.is_alive()
        [key] = keys.all()
        assert not key.usable
        assert key.sha256 != made.sha256


def test_a_use_is_noted_once_a_minute(keys: ApiKeys, client: redis.Redis) -> None:
    key, _ = keys.create("me", Role.VIEWER, KeyLimits())
    assert keys.last_used() == {}
    keys.note_use(key)
    used = keys.last_used()[key.id]
    assert abs((used - key.created_at).total_seconds()) < 60
    client.delete("plateau:keys:used")
    keys.note_use(key)
    assert keys.last_used() == {}


class TestJobs:
    @pytest.fixture
    def key(self, keys: ApiKeys) -> ApiKey:
        return keys.create("nightly", Role.SUBMITTER, KeyLimits(open_jobs=2))[0]

    def test_belong_to_their_key(self, client: redis.Redis, keys: ApiKeys, key: ApiKey) -> None:
        jobs = Jobs(client)
        mine = jobs.create(JobSpec(), name="box", scene_sha256="00", owner=key.id).job
        nobodys = jobs.create(JobSpec(), name="box", scene_sha256="00").job
        assert (mine.owner, mine.owner_name) == (key.id, "nightly")
        assert (nobodys.owner, nobodys.owner_name) == (None, None)
        assert keys.owner_of(mine.id) == key.id
        assert keys.owner_of(nobodys.id) == ""
        assert keys.owner_of("0123456789ab") is None
        assert [job.id for job in jobs.search(owner=key.id)[0]] == [mine.id]
        # The name outlives the key
        keys.revoke(key.id)
        assert jobs.get(mine.id).owner_name == "nightly"

    def test_of_two_keys_may_have_the_same_idempotency_key(
        self, client: redis.Redis, keys: ApiKeys, key: ApiKey
    ) -> None:
        other, _ = keys.create("other", Role.SUBMITTER, KeyLimits())
        jobs = Jobs(client)
        made = [
            jobs.create(
                JobSpec(), name="box", scene_sha256="00", idempotency_key="a", digest=d, owner=o
            )
            for d, o in (("1", key.id), ("2", other.id), ("1", key.id), ("2", ""))
        ]
        assert [(one.repeated, one.conflict) for one in made] == [
            (False, False),
            (False, False),
            (True, False),
            (False, False),
        ]
        assert made[2].job.id == made[0].job.id
