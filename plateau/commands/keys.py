"""`plateau keys`: API keys, in the farm's Redis itself, so an operator needs no API key."""

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from plateau.commands import options as o
from plateau.commands.app import group
from plateau.commands.printing import print_json
from plateau.errors import CommandFailed, tell

if TYPE_CHECKING:
    from plateau.farm.ledger.api_keys import ApiKey, ApiKeys, KeyLimits, Role
    from plateau.farm.redis.client import RedisClient

_COLUMNS: Final = ("id", "name", "role", "made", "last used", "open jobs", "revoked")
_SPARE: Final = ("open jobs", "last used", "made")  # on a narrow terminal
#: For a Redis that starts at the same time, and whose volume may have to be made first.
_PATIENCE_S: Final = 300.0

_KeyId = Annotated[
    str,
    typer.Argument(metavar="KEY", help="The key's id or name, as `plateau keys list` shows it."),
]

keys = group(
    "keys",
    """
    API keys: who may use the service, in which role, with which limits.

    Works on PLATEAU_REDIS_URL if it is set, otherwise on the data folder, whether `plateau up` is
    running or not. Once a key has been made, every request to the service needs one.
    """,
)


@keys.command()
def create(
    name: Annotated[
        str, typer.Argument(help="The person or program that uses it; shown with each job.")
    ],
    role: Annotated[
        str,
        typer.Option(
            help="viewer (reads), submitter (also submits jobs and controls its own) or admin "
            "(also controls the jobs of others)."
        ),
    ] = "submitter",
    upload_gb: Annotated[
        float | None,
        typer.Option(
            help="Largest scene that it may upload, in GB.",
            show_default="PLATEAU_MAX_UPLOAD_GB",
            min=0,
            max=2**20,
        ),
    ] = None,
    scenes_gb: Annotated[
        float,
        typer.Option(help="Total size of the scenes that it may store, in GB.", min=0, max=2**30),
    ] = 50.0,
    open_jobs: Annotated[int, typer.Option(help="Jobs that it may have open at once.")] = 10_000,
    key_from: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="FILE",
            help="Take the key from FILE, such as a mounted secret, instead of making one. Nothing "
            "is printed, and repeating it is harmless. Waits 5 minutes for a Redis that is away.",
        ),
    ] = None,
    as_json: o.Json = False,
) -> None:
    """Make a key and print it. It cannot be printed again: only a hash of it is kept.

    For example:
      export PLATEAU_KEY=$(plateau keys create me)
      plateau keys create prometheus --role viewer > /etc/prometheus/plateau.key
      plateau keys create scaler --role viewer --from /run/secrets/plateau-scaler
    """
    from plateau.processes.read_settings import secret_in

    if not (name.isprintable() and name.strip() and len(name) <= 100):
        raise CommandFailed("a key's name has 1 to 100 printable characters")
    known = _role(role)
    allowed = _limits(
        upload_gb=upload_gb,
        scenes_gb=scenes_gb,
        open_jobs=open_jobs,
    )
    shown = None if key_from is None else secret_in(key_from, "--from")
    patience_s = 0.0 if shown is None else _PATIENCE_S
    with _keys(may_begin=True, patience_s=patience_s) as keys:
        first = not keys.any_made()
        if shown is None:
            key, made = keys.create(name, known, allowed)
            _show(key, made, as_json=as_json)
        else:
            key = keys.admit(shown, name, known, allowed)
            if as_json:
                print_json(_document(key, None))
    done = "made" if shown is None else "took"
    tell(f"{done} key {key.id} ({key.name}) with the role {key.role.value}")
    if first:
        tell("this is the first key: from now on, every request to the service needs a key")


@keys.command("list")
def list_keys(as_json: o.Json = False) -> None:
    """List all keys, revoked ones included. Their secrets cannot be shown again.

    For example:
      plateau keys list
    """
    from plateau.terminal.tables import print_rows

    with _keys() as keys:
        found, used = keys.all(), keys.last_used()
    if as_json:
        print_json([_document(key, used.get(key.id)) for key in found])
    else:
        print_rows(
            _COLUMNS,
            [_row(key, used.get(key.id)) for key in found],
            none="there is no key yet: the service is open to everybody on its machine, and "
            "listens only there; `plateau keys create NAME` makes a key",
            spare=_SPARE,
        )


@keys.command()
def rotate(given: _KeyId, as_json: o.Json = False) -> None:
    """Give a key another secret and print it. The old secret stops working at once.

    For example:
      plateau keys rotate 3f9ac2d01b77

    Name, role, limits and jobs stay. Another key could not control these jobs.
    """
    with _keys() as keys:
        key, shown = keys.rotate(_named(keys, given).id)
    _show(key, shown, as_json=as_json)
    tell(f"key {key.id} ({key.name}) has a new secret; the old one is refused from now on")


@keys.command()
def revoke(given: _KeyId, as_json: o.Json = False) -> None:
    """Revoke a key. It stops working at once; its jobs continue and keep its name.

    For example:
      plateau keys revoke 3f9ac2d01b77
    """
    with _keys() as keys:
        key = keys.revoke(_named(keys, given).id)
        left = any(one.usable for one in keys.all())
    if as_json:
        print_json(_document(key, None))
    tell(f"key {key.id} ({key.name}) is refused from now on; its jobs continue")
    if not left:
        tell(
            "that was the last key, and the service still requires one: `plateau keys create "
            "NAME` makes another"
        )


@contextmanager
def _keys(*, may_begin: bool = False, patience_s: float = 0.0) -> "Iterator[ApiKeys]":
    """The keys in the farm's Redis, after a check of its data's layout."""
    from plateau.farm.ledger.api_keys import ApiKeys
    from plateau.farm.redis.link import connect
    from plateau.processes.data_folder import DataFolder
    from plateau.processes.read_settings import farm_settings
    from plateau.processes.redis_at_hand import redis_at_hand

    settings = farm_settings()
    data = DataFolder(settings.data)
    with ExitStack() as stack:
        url = redis_at_hand(settings, data, stack, may_begin=may_begin)
        client = stack.enter_context(connect(url))
        _check(client, patience_s)
        yield ApiKeys(client)


def _check(client: "RedisClient", patience_s: float) -> None:
    """Check the layout of the data, and wait for as long as this for a Redis that is away."""
    from plateau.farm.ledger.schema import check_schema
    from plateau.farm.model.errors import StoreUnavailable

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


def _named(keys: "ApiKeys", given: str) -> "ApiKey":
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


def _role(name: str) -> "Role":
    from plateau.farm.ledger.api_keys import Role

    try:
        return Role(name)
    except ValueError:
        known = ", ".join(role.value for role in Role)
        raise CommandFailed(f"there is no role {name!r}; there are {known}") from None


def _limits(**given: float | None) -> "KeyLimits":
    from pydantic import ValidationError

    from plateau.farm.ledger.api_keys import KeyLimits
    from plateau.farm.model import input_errors

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


def _show(key: "ApiKey", shown: str, *, as_json: bool) -> None:
    if as_json:
        print_json({**_document(key, None), "key": shown})
    else:
        print(shown)


def _document(key: "ApiKey", last_used: datetime | None) -> dict[str, Any]:
    document: dict[str, Any] = key.model_dump(mode="json", exclude={"sha256"})
    return {**document, "last_used_at": None if last_used is None else last_used.isoformat()}


def _row(key: "ApiKey", last_used: datetime | None) -> tuple[str, ...]:
    limits = key.limits
    return (
        key.id,
        key.name,
        key.role.value,
        _day(key.created_at),
        "never" if last_used is None else f"{last_used:%Y-%m-%d %H:%M}",
        "any" if limits.open_jobs is None else f"{limits.open_jobs:,}",
        "–" if key.revoked_at is None else _day(key.revoked_at),
    )


def _day(moment: datetime) -> str:
    return f"{moment:%Y-%m-%d}"
