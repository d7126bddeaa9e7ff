"""The command that says what each process may do in Redis."""

from pathlib import Path
from typing import Annotated

import typer

from plateau.cli.app import app


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
    `ACL LOAD`. A newer Plateau may need other rights: make the file again before you start it.
    """
    from plateau.commands.redis_acl import redis_acl as run

    run(passwords, redis)
