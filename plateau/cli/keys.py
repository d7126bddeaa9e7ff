"""Commands that make, list, rotate and revoke API keys."""

from pathlib import Path
from typing import Annotated

import typer

from plateau.cli import options as o
from plateau.cli.app import group

_KeyId = Annotated[
    str,
    typer.Argument(metavar="KEY", help="The key's id or name, as `plateau keys list` shows it."),
]

keys = group(
    "keys",
    """
    API keys: who may use the service, as what, and how much.

    Works on PLATEAU_REDIS_URL where it is set, and on the data folder else, whether `plateau up`
    runs there or not. Once a key was ever made, every request to the service needs one.
    """,
)


@keys.command()
def create(
    name: Annotated[str, typer.Argument(help="Whose it is, or what for: shown with each job.")],
    role: Annotated[
        str,
        typer.Option(
            help="viewer (looks), submitter (submits, and steers its own jobs) or admin (steers "
            "everybody's)."
        ),
    ] = "submitter",
    requests_per_minute: Annotated[
        float | None,
        typer.Option(
            help="How many requests a minute it may make.",
            show_default="PLATEAU_KEY_REQUESTS_PER_MINUTE",
        ),
    ] = None,
    burst: Annotated[
        int | None,
        typer.Option(help="And how many at once, after a pause.", show_default="PLATEAU_KEY_BURST"),
    ] = None,
    upload_gb: Annotated[
        float | None,
        typer.Option(
            help="Largest scene that it may upload.",
            show_default="PLATEAU_KEY_UPLOAD_GB",
            max=2**20,
        ),
    ] = None,
    scenes_gb: Annotated[
        float | None,
        typer.Option(
            help="How much it may have stored of scenes.",
            show_default="PLATEAU_KEY_SCENES_GB",
            max=2**30,
        ),
    ] = None,
    open_jobs: Annotated[
        int | None,
        typer.Option(
            help="How many of its jobs may be open at once.", show_default="PLATEAU_KEY_OPEN_JOBS"
        ),
    ] = None,
    key_from: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="FILE",
            help="Take the key from FILE, where who runs the machines keeps it, instead of making "
            "one; nothing is printed, and doing it again is harmless.",
        ),
    ] = None,
    as_json: o.Json = False,
) -> None:
    """Make a key, and print it: this once, for only a hash of it is kept.

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
    """List the keys that were ever made; what they open with, nobody can show again.

    For example:
      plateau keys list
    """
    from plateau.commands.keys import list_keys as run

    run(as_json=as_json)


@keys.command()
def rotate(key_id: _KeyId, as_json: o.Json = False) -> None:
    """Give a key another secret, and print it; the old one opens nothing from now on.

    For example:
      plateau keys rotate 3f9ac2d01b77

    Name, role and limits stay, and so do its jobs, which another key could not steer.
    """
    from plateau.commands.keys import rotate as run

    run(key_id, as_json=as_json)


@keys.command()
def revoke(key_id: _KeyId, as_json: o.Json = False) -> None:
    """Revoke a key: it opens nothing from now on. Its jobs go on, and keep its name.

    For example:
      plateau keys revoke 3f9ac2d01b77
    """
    from plateau.commands.keys import revoke as run

    run(key_id, as_json=as_json)
