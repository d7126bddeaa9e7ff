"""API keys, kept in one hash of Redis.

A key is shown once, as ``plateau_<id>_<secret>``; its id is no secret and names it from then on.
The secret has 256 random bits, so a plain SHA-256 of it is stored: a slow hash, such as scrypt,
would cost each request milliseconds, and nobody can guess the secret anyway.

A revoked key stays: its jobs keep an owner, and the API does not become open again.
"""

import hashlib
import hmac
import re
import secrets
import time
from collections.abc import Callable
from datetime import datetime
from enum import Enum
from typing import Final

from pydantic import Field

from plateau.farm.model.errors import UnknownKey
from plateau.farm.model.job import moment
from plateau.farm.model.record import Record
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.api_keys import NoteUse, PutKey
from plateau.farm.redis.link import now_ms
from plateau.farm.redis.scripts import OnRedis

_SECRET_BYTES: Final = 32
#: An API process notes a key's use so often: each note is written to the disk.
_NOTED_EVERY_S: Final = 60.0
_SHOWN: Final = re.compile(r"plateau_([0-9a-f]{12})_([0-9a-f]{64})")


class Role(str, Enum):
    """What a key may do; each role includes those before it."""

    VIEWER = "viewer"  #: look at everything
    SUBMITTER = "submitter"  #: submit jobs, and steer its own
    ADMIN = "admin"  #: steer everybody's jobs

    def includes(self, other: "Role") -> bool:
        """Whether this role may do what the other may."""
        roles = list(Role)
        return roles.index(self) >= roles.index(other)


class KeyLimits(Record):
    """How much may be done with a key."""

    upload_bytes: int | None = Field(
        None, ge=1, le=2**50, description="largest upload; null: the farm's limit"
    )
    open_jobs: int | None = Field(
        None, ge=1, le=1_000_000_000, description="most jobs that have not ended; null: any"
    )
    scenes_bytes: int | None = Field(
        None, ge=1, le=2**60, description="most bytes of scenes that it has stored; null: any"
    )


class ApiKey(Record):
    """A key without its secret."""

    id: str
    name: str
    role: Role
    sha256: str = Field(repr=False, description="of the secret, in hexadecimal")
    created_at: datetime
    revoked_at: datetime | None = None
    limits: KeyLimits

    @property
    def usable(self) -> bool:
        """Whether the key was not revoked."""
        return self.revoked_at is None


class ApiKeys(OnRedis):
    """All keys. Every method raises `StoreUnavailable` when Redis is away."""

    def __init__(self, client: RedisClient) -> None:
        super().__init__(client)
        self._note_after: dict[str, float] = {}  # by id, on the monotonic clock

    def create(self, name: str, role: Role, limits: KeyLimits) -> tuple[ApiKey, str]:
        """A new key, and its only showing."""
        key_id = secrets.token_hex(6)
        secret, sha256 = _new_secret()
        key = ApiKey(
            id=key_id, name=name, role=role, sha256=sha256, created_at=self._now(), limits=limits
        )
        self._put(key)
        return key, _shown(key_id, secret)

    def admit(self, shown: str, name: str, role: Role, limits: KeyLimits) -> ApiKey:
        """Store a key that somebody else made, given as it is shown; returns it.

        A known key of this id gets this name, role, secret and limits: repeating it is harmless,
        and another secret is a rotation.

        Raises
        ------
        UnknownKey
            It does not have the form of a key, or the key of this id was revoked.
        """
        match = _SHOWN.fullmatch(shown)
        if match is None:
            raise UnknownKey("a key is plateau_, 12 hexadecimal digits, _ and 64 more")
        key_id, secret = match.groups()
        new = ApiKey(
            id=key_id,
            name=name,
            role=role,
            sha256=_sha256(secret),
            created_at=self._now(),
            limits=limits,
        )
        if self._put(new):
            return new

        return self._change(
            key_id, lambda key: new.model_copy(update={"created_at": _alive(key).created_at})
        )

    def rotate(self, key_id: str) -> tuple[ApiKey, str]:
        """The same key with another secret, and its only showing.

        The old secret opens nothing from now on; the key's jobs stay its own.

        Raises
        ------
        UnknownKey
            There is no such key, or it was revoked.
        """
        secret, sha256 = _new_secret()
        key = self._change(key_id, lambda key: _alive(key).model_copy(update={"sha256": sha256}))
        return key, _shown(key_id, secret)

    def revoke(self, key_id: str) -> ApiKey:
        """Revoke the key: it opens nothing from now on. Repeating it is harmless.

        Raises
        ------
        UnknownKey
            There is no such key.
        """
        now = self._now()
        return self._change(
            key_id, lambda key: key.model_copy(update={"revoked_at": key.revoked_at or now})
        )

    def all(self) -> list[ApiKey]:
        """Every key ever made, by age."""
        texts = self._redis.hvals(keys.API_KEYS)
        found = [ApiKey.model_validate_json(text) for text in texts]
        return sorted(found, key=lambda key: key.created_at)

    def note_use(self, key: ApiKey) -> None:
        """Note that the key is used, once a minute."""
        now = time.monotonic()
        if now >= self._note_after.get(key.id, now):
            self._scripts.run(NoteUse(key=key.id))
            self._note_after[key.id] = now + _NOTED_EVERY_S

    def last_used(self) -> dict[str, datetime]:
        """When each key was last used, to a minute, without keys that never were."""
        used = self._redis.hgetall(keys.API_KEYS_USED)
        return {key_id: moment(at) for key_id, at in used.items()}

    def any_made(self) -> bool:
        """Whether a key was ever made: from then on the API wants one."""
        return bool(self._redis.exists(keys.API_KEYS))

    def find(self, shown: str) -> ApiKey | None:
        """The key of this showing, if it is known and was not revoked."""
        match = _SHOWN.fullmatch(shown)
        if match is None:
            return None
        text = self._redis.hget(keys.API_KEYS, match[1])
        key = None if text is None else ApiKey.model_validate_json(text)
        if key is None or not hmac.compare_digest(_sha256(match[2]), key.sha256):
            return None
        return key if key.usable else None

    def owner_of(self, job_id: str) -> str | None:
        """Id of the key that made the job; "" where none did, None where there is no such job."""
        pipe = self._redis.pipeline(transaction=False)
        pipe.exists(keys.job(job_id))
        pipe.hget(keys.job(job_id, "sealed"), "owner")
        known, owner = pipe.execute()
        return owner or "" if known else None

    def _change(self, key_id: str, changed: Callable[[ApiKey], ApiKey]) -> ApiKey:
        """Change a key and return it; simultaneous changes are done one after the other."""
        while True:
            text = self._redis.hget(keys.API_KEYS, key_id)
            if text is None:
                raise UnknownKey(
                    f"there is no key {key_id!r}; `plateau keys list` shows those there are"
                )
            key = changed(ApiKey.model_validate_json(text))
            if self._put(key, instead_of=text):
                return key

    def _put(self, key: ApiKey, instead_of: str = "") -> bool:
        """Store the key; False where another version is stored by now."""
        known = key.model_dump_json()
        return self._scripts.run(PutKey(key=key.id, instead_of=instead_of, known=known))

    def _now(self) -> datetime:
        return moment(now_ms(self._redis))


def _alive(key: ApiKey) -> ApiKey:
    if not key.usable:
        raise UnknownKey(f"key {key.id} ({key.name}) was revoked; make another")
    return key


def _new_secret() -> tuple[str, str]:
    secret = secrets.token_hex(_SECRET_BYTES)
    return secret, _sha256(secret)


def _sha256(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()


def _shown(key_id: str, secret: str) -> str:
    return f"plateau_{key_id}_{secret}"
