"""API keys: made, looked up, given another secret, revoked; kept in one hash of Redis.

A key is shown once, as ``plateau_<id>_<secret>``; its id is no secret and names it from then on.
The secret has 256 random bits, so its plain SHA-256 is stored: what slows guessing down, as scrypt
does for passwords, would cost each request milliseconds and protect nothing: nobody guesses that.

A revoked key stays, so that it is known whose a job was, and so that nothing is open again.
"""

import hashlib
import hmac
import re
import secrets
from collections.abc import Callable
from datetime import datetime
from enum import Enum
from typing import Final

from pydantic import BaseModel, ConfigDict, Field

from plateau.farm.model.errors import UnknownKey
from plateau.farm.model.job import moment
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.api_keys import PutKey
from plateau.farm.redis.link import now_ms, unavailable_as_farm_error
from plateau.farm.redis.scripts import Scripts

_SECRET_BYTES: Final = 32
_SHOWN: Final = re.compile(r"plateau_([0-9a-f]{12})_([0-9a-f]{64})")


class Role(str, Enum):
    """What a key may do; each may what those before it may."""

    VIEWER = "viewer"  #: look at everything
    SUBMITTER = "submitter"  #: submit jobs, and steer its own
    ADMIN = "admin"  #: steer everybody's jobs

    def includes(self, other: "Role") -> bool:
        """Whether who has this role may do what the other may."""
        roles = list(Role)
        return roles.index(self) >= roles.index(other)


class KeyLimits(BaseModel):
    """How much may be done with a key."""

    model_config = ConfigDict(frozen=True)

    requests_per_minute: float = Field(gt=0, le=1e6)
    burst: int = Field(
        ge=1, le=1_000_000, description="requests that may come at once, after a pause"
    )
    upload_bytes: int | None = Field(
        ge=1, le=2**50, description="largest upload; null: the farm's limit"
    )
    open_jobs: int | None = Field(
        ge=1, le=1_000_000_000, description="most jobs that have not ended; null: any"
    )
    scenes_bytes: int | None = Field(
        None, ge=1, le=2**60, description="most bytes of scenes that it has stored; null: any"
    )


class ApiKey(BaseModel):
    """What is known of a key; its secret is not."""

    model_config = ConfigDict(frozen=True)

    id: str
    name: str
    role: Role
    sha256: str = Field(repr=False, description="of the secret, in hexadecimal")
    created_at: datetime
    revoked_at: datetime | None = None
    limits: KeyLimits

    @property
    def usable(self) -> bool:
        """Whether it was not revoked."""
        return self.revoked_at is None


class ApiKeys:
    """All keys. Every method raises `StoreUnavailable` when Redis is away."""

    def __init__(self, client: RedisClient) -> None:
        self._redis = client
        self._scripts = Scripts(client)

    def create(self, name: str, role: Role, limits: KeyLimits) -> tuple[ApiKey, str]:
        """A new key, and the form in which it is shown this once."""
        key_id = secrets.token_hex(6)
        secret, sha256 = _new_secret()
        key = ApiKey(
            id=key_id, name=name, role=role, sha256=sha256, created_at=self._now(), limits=limits
        )
        self._put(key)
        return key, _shown(key_id, secret)

    def admit(self, shown: str, name: str, role: Role, limits: KeyLimits) -> ApiKey:
        """The key that somebody else made, in the form in which it is shown; known from now on.

        One of the same id gets this name, role, secret and limits, so doing it again is harmless,
        and another secret of that id is a rotation.

        Raises
        ------
        UnknownKey
            It has not the form of a key, or the key of that id was revoked.
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

        def changed(key: ApiKey) -> ApiKey:
            if not key.usable:
                raise UnknownKey(f"key {key_id} ({key.name}) was revoked; make another")
            return new.model_copy(update={"created_at": key.created_at})

        return self._change(key_id, changed)

    def rotate(self, key_id: str) -> tuple[ApiKey, str]:
        """The same key with another secret, and the form in which that is shown this once.

        The old secret opens nothing from now on; the key's jobs stay its own.

        Raises
        ------
        UnknownKey
            There is no such key, or it was revoked.
        """
        secret, sha256 = _new_secret()

        def changed(key: ApiKey) -> ApiKey:
            if not key.usable:
                raise UnknownKey(f"key {key_id} ({key.name}) was revoked; make another")
            return key.model_copy(update={"sha256": sha256})

        return self._change(key_id, changed), _shown(key_id, secret)

    def revoke(self, key_id: str) -> ApiKey:
        """The key, which opens nothing from now on; revoking it again is harmless.

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
        """Every key that was ever made, by age."""
        with unavailable_as_farm_error():
            texts = self._redis.hvals(keys.API_KEYS)
        found = [ApiKey.model_validate_json(text) for text in texts]
        return sorted(found, key=lambda key: key.created_at)

    def last_used(self) -> dict[str, datetime]:
        """When each key was last used, to a minute; those that never were are left out."""
        with unavailable_as_farm_error():
            used = self._redis.hgetall(keys.API_KEYS_USED)
        return {key_id: moment(at) for key_id, at in used.items()}

    def any_made(self) -> bool:
        """Whether a key was ever made: from then on the API wants one."""
        with unavailable_as_farm_error():
            return bool(self._redis.exists(keys.API_KEYS))

    def find(self, shown: str) -> ApiKey | None:
        """The key that is shown in this form, where it is known and was not revoked."""
        match = _SHOWN.fullmatch(shown)
        if match is None:
            return None
        with unavailable_as_farm_error():
            text = self._redis.hget(keys.API_KEYS, match[1])
        key = None if text is None else ApiKey.model_validate_json(text)
        return key if key is not None and opens(key, shown) else None

    def owner_of(self, job_id: str) -> str | None:
        """Id of the key that made the job; "" where none did, None where there is no such job."""
        with unavailable_as_farm_error():
            pipe = self._redis.pipeline(transaction=False)
            pipe.exists(keys.job(job_id))
            pipe.hget(keys.job(job_id, "sealed"), "owner")
            known, owner = pipe.execute()
        return owner or "" if known else None

    def _change(self, key_id: str, changed: Callable[[ApiKey], ApiKey]) -> ApiKey:
        """The key after a change; where two change it at once, one after the other."""
        while True:
            with unavailable_as_farm_error():
                text = self._redis.hget(keys.API_KEYS, key_id)
            if text is None:
                raise UnknownKey(
                    f"there is no key {key_id!r}; `plateau keys list` shows those there are"
                )
            key = changed(ApiKey.model_validate_json(text))
            if self._put(key, instead_of=text):
                return key

    def _put(self, key: ApiKey, instead_of: str = "") -> bool:
        """Store the key; False where what is stored is another by now."""
        known = key.model_dump_json()
        return self._scripts.run(PutKey(key=key.id, instead_of=instead_of, known=known))

    def _now(self) -> datetime:
        with unavailable_as_farm_error():
            return moment(now_ms(self._redis))


def opens(key: ApiKey, shown: str) -> bool:
    """Whether the shown form is the key's, and it was not revoked; its time tells nothing."""
    match = _SHOWN.fullmatch(shown)
    secret = match[2] if match is not None and match[1] == key.id else ""
    return hmac.compare_digest(_sha256(secret), key.sha256) and key.usable


def _new_secret() -> tuple[str, str]:
    secret = secrets.token_hex(_SECRET_BYTES)
    return secret, _sha256(secret)


def _sha256(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()


def _shown(key_id: str, secret: str) -> str:
    return f"plateau_{key_id}_{secret}"
