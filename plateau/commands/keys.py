"""`plateau keys` and `plateau redis-acl`: access rights.

The first works on the farm's Redis directly, so an operator needs no API key.
"""

import json
import os
import re
import secrets
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from plateau.errors import CommandFailed, tell
from plateau.farm.ledger.api_keys import ApiKey, ApiKeys, KeyLimits, Role
from plateau.farm.ledger.schema import check_schema
from plateau.farm.model import input_errors
from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.process.settings import Settings
from plateau.farm.redis.acl import acl_file, rules
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.link import connect
from plateau.files.out_folder import make
from plateau.processes.data_folder import DataFolder
from plateau.processes.read_settings import farm_settings, secret_in
from plateau.processes.redis_at_hand import redis_at_hand
from plateau.terminal.tables import print_rows

_COLUMNS: Final = ("id", "name", "role", "made", "last used", "requests", "open jobs", "revoked")
_SPARE: Final = ("requests", "open jobs", "last used", "made")  # on a narrow terminal
#: For a Redis that starts at the same time, and whose volume may have to be made first.
_PATIENCE_S: Final = 300.0
_REDIS_VERSION: Final = re.compile(r"(\d+)\.(\d+)(\.\d+)*")


def create(
    name: str, role: str, limits: dict[str, float | None], *, key_from: Path | None, as_json: bool
) -> None:
    """Make a key and print it on standard output, and messages on standard error.

    A key from a file is not printed, and waits for a Redis that is away, for some minutes: whoever
    deploys a farm starts it and its Redis at once.
    """
    settings = farm_settings()
    if not (name.isprintable() and name.strip() and len(name) <= 100):
        raise CommandFailed("a key's name has 1 to 100 printable characters")
    known, allowed = _role(role), _limits(limits)
    shown = None if key_from is None else secret_in(key_from, "--from")
    patience_s = 0.0 if shown is None else _PATIENCE_S
    with _keys(settings, may_begin=True, patience_s=patience_s) as keys:
        first = not keys.any_made()
        if shown is None:
            key, made = keys.create(name, known, allowed)
            _show(key, made, as_json=as_json)
        else:
            key = keys.admit(shown, name, known, allowed)
            if as_json:
                print(json.dumps(_document(key, None), indent=2))
    done = "made" if shown is None else "took"
    tell(f"{done} key {key.id} ({key.name}) with the role {key.role.value}")
    if first:
        tell("this is the first key: from now on, every request to the service needs a key")


def list_keys(*, as_json: bool) -> None:
    """Print all keys, by age."""
    with _keys(farm_settings()) as keys:
        found, used = keys.all(), keys.last_used()
    if as_json:
        print(json.dumps([_document(key, used.get(key.id)) for key in found], indent=2))
    else:
        print_rows(
            _COLUMNS,
            [_row(key, used.get(key.id)) for key in found],
            none="there is no key yet: the service is open to everybody on its machine, and "
            "listens only there; `plateau keys create NAME` makes a key",
            spare=_SPARE,
        )


def rotate(given: str, *, as_json: bool) -> None:
    """Give a key another secret; prints as `create`."""
    with _keys(farm_settings()) as keys:
        key, shown = keys.rotate(_named(keys, given).id)
    _show(key, shown, as_json=as_json)
    tell(f"key {key.id} ({key.name}) has a new secret; the old one is refused from now on")


def revoke(given: str, *, as_json: bool) -> None:
    """Revoke a key."""
    with _keys(farm_settings()) as keys:
        key = keys.revoke(_named(keys, given).id)
        left = any(one.usable for one in keys.all())
    if as_json:
        print(json.dumps(_document(key, None), indent=2))
    tell(f"key {key.id} ({key.name}) is refused from now on; its jobs continue")
    if not left:
        tell(
            "that was the last key, and the service still requires one: `plateau keys create "
            "NAME` makes another"
        )


@contextmanager
def _keys(
    settings: Settings, *, may_begin: bool = False, patience_s: float = 0.0
) -> Iterator[ApiKeys]:
    """The keys in the farm's Redis, after a check of its data's layout."""
    data = DataFolder(settings.data)
    with ExitStack() as stack:
        url = redis_at_hand(settings, data, stack, may_begin=may_begin)
        client = stack.enter_context(connect(url))
        _check(client, patience_s)
        yield ApiKeys(client)


def _check(client: RedisClient, patience_s: float) -> None:
    """Check the layout of the data, and wait for as long as this for a Redis that is away."""
    deadline, told = time.monotonic() + patience_s, False
    while True:
        try:
            return check_schema(client)
        except StoreUnavailable as error:
            if time.monotonic() >= deadline:
                raise
            if not told:
                tell(f"{error}; trying again for {patience_s / 60:.0f} minutes")
            told = True
        time.sleep(1)


def _named(keys: ApiKeys, given: str) -> ApiKey:
    """The key with this id, or the only key with this name; usable keys come before revoked."""
    every = keys.all()
    same_id = [key for key in every if key.id == given]
    named = [key for key in every if key.name == given]
    found = same_id or [key for key in named if key.usable] or named
    if len(found) > 1:
        ids = ", ".join(key.id for key in found)
        raise CommandFailed(f"{len(found)} keys have the name {given!r}: give an id, of {ids}")
    if not found:
        raise CommandFailed(
            f"no key has the id or the name {given!r}; `plateau keys list` shows the keys"
        )
    return found[0]


def _role(name: str) -> Role:
    try:
        return Role(name)
    except ValueError:
        known = ", ".join(role.value for role in Role)
        raise CommandFailed(f"there is no role {name!r}; there are {known}") from None


def _limits(given: dict[str, float | None]) -> KeyLimits:
    asked: dict[str, Any] = dict(given)
    for name in ("upload", "scenes"):
        gigabytes = asked.pop(f"{name}_gb")
        asked[f"{name}_bytes"] = None if gigabytes is None else round(gigabytes * 2**30)
    try:
        return KeyLimits(**asked)
    except ValidationError as error:
        found = error.errors()[0]
        option = str(found["loc"][-1]).replace("_bytes", "_gb").replace("_", "-")
        message = input_errors.message(found)
        if option.endswith("-gb"):  # the message is about bytes
            message = "must be above 0"
        raise CommandFailed(f"--{option}: {message}") from None


def _show(key: ApiKey, shown: str, *, as_json: bool) -> None:
    print(json.dumps({**_document(key, None), "key": shown}, indent=2) if as_json else shown)


def _document(key: ApiKey, last_used: datetime | None) -> dict[str, Any]:
    document: dict[str, Any] = key.model_dump(mode="json", exclude={"sha256"})
    return {**document, "last_used_at": None if last_used is None else last_used.isoformat()}


def _row(key: ApiKey, last_used: datetime | None) -> tuple[str, ...]:
    limits = key.limits
    return (
        key.id,
        key.name,
        key.role.value,
        _day(key.created_at),
        "never" if last_used is None else f"{last_used:%Y-%m-%d %H:%M}",
        f"{limits.requests_per_minute:g}/min, {limits.burst:,} at once",
        "any" if limits.open_jobs is None else f"{limits.open_jobs:,}",
        "–" if key.revoked_at is None else _day(key.revoked_at),
    )


def _day(moment: datetime) -> str:
    return f"{moment:%Y-%m-%d}"


def redis_acl(passwords: Path | None, redis: str) -> None:
    """Print an ACL file; makes the passwords that are missing in their folder."""
    match = _REDIS_VERSION.fullmatch(redis)
    version = (int(match[1]), int(match[2])) if match else (0, 0)
    if version < (6, 2):
        raise CommandFailed(f"{redis!r} is not a version of Redis from 6.2 on")
    users = rules(version)
    known = {} if passwords is None else {user: _password(passwords, user) for user in users}
    print(acl_file(known, version), end="")


def _password(folder: Path, user: str) -> str:
    """The user's password; a missing one is made, in a file that only its owner can read."""
    file = folder / f"{user}.password"
    if not file.exists():
        make(folder, "--passwords", mode=0o700)
        descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "w") as made:
            made.write(f"{secrets.token_hex(32)}\n")
        tell(f"made {file}")
    password = file.read_text().strip()
    if not password:
        raise CommandFailed(f"{file} is empty")
    return password
