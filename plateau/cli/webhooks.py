"""Commands for webhooks: their messages, and the secret that signs them."""

from typing import Annotated

import typer

from plateau.cli import options as o
from plateau.cli.app import app, group


@app.command()
def notify(
    target: Annotated[
        str, typer.Argument(metavar="NAME", help="A target's name in PLATEAU_NOTIFY_FILE.")
    ],
    as_json: o.Json = False,
) -> None:
    """Send a test message to a target of notifications, and say whether it was taken.

    For example:
      PLATEAU_NOTIFY_FILE=/etc/plateau/targets plateau notify ops

    `plateau submit --notify NAME` has a target notified of a job's end. Where a message cannot be
    sent, the reason is shown, and may have parts of the target's URL.
    """
    from plateau.commands.notify import notify as run

    run(target, as_json=as_json)


webhooks = group(
    "webhooks",
    """
    Webhooks: requests that report a job's events, as `plateau submit --webhook URL` asks for.
    """,
)


@webhooks.command("list")
def list_deliveries(job_id: o.JobId, url: o.Url = None, as_json: o.Json = False) -> None:
    """List the messages to a job's webhook, and whether each was delivered.

    For example:
      plateau webhooks list 3f9ac2d01b77
    """
    from plateau.commands.webhooks import list_deliveries as run

    run(job_id, url=url, as_json=as_json)


@webhooks.command()
def redeliver(
    job_id: o.JobId,
    number: Annotated[
        int, typer.Argument(metavar="N", min=1, help="The message's number, as `list` shows it.")
    ],
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Send a message again now, unchanged and with the same id.

    For example:
      plateau webhooks redeliver 3f9ac2d01b77 2
    """
    from plateau.commands.webhooks import redeliver as run

    run(job_id, number, url=url, as_json=as_json)


@webhooks.command()
def secret(
    renew: Annotated[
        bool,
        typer.Option(
            "--renew", help="Make another secret; for a day, messages are signed with both."
        ),
    ] = False,
    as_json: o.Json = False,
) -> None:
    """Print the secret that signs the messages of jobs without a secret of their own.

    For example:
      plateau webhooks secret > /etc/studio/plateau-webhooks.secret

    Works on PLATEAU_REDIS_URL if it is set, otherwise on the data folder, whether `plateau up` is
    running or not.
    """
    from plateau.commands.keys import webhook_secret as run

    run(renew=renew, as_json=as_json)
