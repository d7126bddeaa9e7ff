"""Commands of an operator: API keys, the users of Redis, and a test of a notice's target."""

from pathlib import Path
from typing import Annotated

import typer

from plateau.cli import options as o
from plateau.cli.app import app, group

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
    requests_per_minute: Annotated[
        float, typer.Option(help="Requests a minute that it may make.")
    ] = 1200.0,
    burst: Annotated[
        int, typer.Option(help="Requests that it may make at once, after a pause.")
    ] = 200,
    upload_gb: Annotated[
        float | None,
        typer.Option(
            help="Largest scene that it may upload, in GB.",
            show_default="PLATEAU_MAX_UPLOAD_GB",
            max=2**20,
        ),
    ] = None,
    scenes_gb: Annotated[
        float,
        typer.Option(help="Total size of the scenes that it may store, in GB.", max=2**30),
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
    from plateau.commands.keys import create as run

    run(
        name,
        role,
        {
            "requests_per_minute": requests_per_minute,
            "burst": burst,
            "upload_gb": upload_gb,
            "scenes_gb": scenes_gb,
            "open_jobs": open_jobs,
        },
        key_from=key_from,
        as_json=as_json,
    )


@keys.command("list")
def list_keys(as_json: o.Json = False) -> None:
    """List all keys, revoked ones included. Their secrets cannot be shown again.

    For example:
      plateau keys list
    """
    from plateau.commands.keys import list_keys as run

    run(as_json=as_json)


@keys.command()
def rotate(key_id: _KeyId, as_json: o.Json = False) -> None:
    """Give a key another secret and print it. The old secret stops working at once.

    For example:
      plateau keys rotate 3f9ac2d01b77

    Name, role, limits and jobs stay. Another key could not control these jobs.
    """
    from plateau.commands.keys import rotate as run

    run(key_id, as_json=as_json)


@keys.command()
def revoke(key_id: _KeyId, as_json: o.Json = False) -> None:
    """Revoke a key. It stops working at once; its jobs continue and keep its name.

    For example:
      plateau keys revoke 3f9ac2d01b77
    """
    from plateau.commands.keys import revoke as run

    run(key_id, as_json=as_json)


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
    from plateau.commands.keys import redis_acl as run

    run(passwords, redis)


@app.command()
def notify(
    target: Annotated[
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
    from plateau.commands.notify import notify as run

    run(target, as_json=as_json)
