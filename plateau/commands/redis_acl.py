"""`plateau redis-acl`: the users of a farm's Redis."""

import os
import re
from pathlib import Path
from typing import Annotated, Final

import typer

from plateau.commands.app import app
from plateau.errors import CommandFailed, tell

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
    import secrets

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
