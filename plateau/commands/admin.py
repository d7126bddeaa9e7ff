"""`plateau redis-acl | notify`: the users of a farm's Redis, and a test of a notice's target."""

import json
import os
import re
import secrets
from pathlib import Path
from typing import Annotated, Final

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.errors import CommandFailed, tell

_NOTICE: Final = "This target is notified when jobs end that name it."
_REDIS_VERSION: Final = re.compile(r"(\d+)\.(\d+)(\.\d+)*")


@app.command("redis-acl")
def redis_acl(
    passwords: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Folder with a password for each user, as USER.password; missing ones are made. "
            "Without it the users have no passwords yet.",
        ),
    ] = None,
    redis: Annotated[
        str,
        typer.Option(
            metavar="VERSION",
            help="Version of the Redis that reads the file; 6.2 has no read-only right.",
        ),
    ] = "7.0",
) -> None:
    """Print an ACL file for a Redis of your own: a user for each kind of process.

    For example:
      plateau redis-acl --passwords /etc/plateau/redis > /etc/redis/users.acl

    A worker's user can access the queue and nothing else. The file holds hashes of the passwords.
    Redis reads it with `aclfile /etc/redis/users.acl` in its configuration, and again on
    `ACL LOAD`. Another Plateau may need other rights: make the file again before you start it.
    """
    from plateau.farm.redis.acl import acl_file, rules

    match = _REDIS_VERSION.fullmatch(redis)
    version = (int(match[1]), int(match[2])) if match else (0, 0)
    if version < (6, 2):
        raise CommandFailed(f"{redis!r} is not a version of Redis from 6.2 on")
    users = rules(version)
    known = {} if passwords is None else {user: _password(passwords, user) for user in users}
    print(acl_file(known, version), end="")


def _password(folder: Path, user: str) -> str:
    """The user's password; a missing one is made, in a file that only its owner can read."""
    from plateau.files.out_folder import make

    file = folder / f"{user}.password"
    if not file.exists():
        make(folder, "--passwords", mode=0o700)
        descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "w", encoding="utf-8") as made:
            made.write(f"{secrets.token_hex(32)}\n")
        tell(f"made {file}")
    password = file.read_text(encoding="utf-8").strip()
    if not password:
        raise CommandFailed(f"{file} is empty")
    return password


@app.command()
def notify(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="A target's name in PLATEAU_NOTIFY_FILE.")
    ],
    as_json: o.Json = False,
) -> None:
    """Send a test message to a target of notices, and say whether it was taken.

    For example:
      PLATEAU_NOTIFY_FILE=/etc/plateau/targets plateau notify ops

    `plateau submit --notify NAME` has a target notified of a job's end. Where a message cannot be
    sent, the reason is shown, and may have parts of the target's URL.
    """
    from plateau.processes.read_settings import read_settings
    from plateau.service.monitor.notifier.notes import Note, NotNotified, send
    from plateau.service.notices.targets import read_targets

    url = read_targets(read_settings()).url(name)
    try:
        send(name, url, Note("Plateau: a test", _NOTICE))
    except NotNotified as error:
        raise CommandFailed(f"{name} was not notified: {error.said}") from None
    print(json.dumps({"target": name, "notified": True}) if as_json else f"{name} was notified")
