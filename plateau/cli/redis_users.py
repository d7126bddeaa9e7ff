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
            help="Where each user's password is, as USER.password; those that are missing are "
            "made. Without it no user has one yet.",
        ),
    ] = None,
    redis: Annotated[
        str,
        typer.Option(
            metavar="VERSION",
            help="The Redis that is to read it. Before 7.0 there is no right to read alone.",
        ),
    ] = "7.0",
) -> None:
    """Print an ACL file for a Redis of your own: a user for each kind of process.

    For example:
      plateau redis-acl --passwords /etc/plateau/redis > /etc/redis/users.acl

    A worker's user can touch the queue and nothing else; the file holds hashes of the passwords.
    Redis reads it by `aclfile /etc/redis/users.acl` in its configuration, and again at `ACL LOAD`.
    A newer Plateau may need other rights: make the file anew before it starts.
    """
    from plateau.commands.redis_acl import redis_acl as run

    run(passwords, redis)
