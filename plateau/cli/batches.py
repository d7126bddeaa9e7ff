"""Commands for batches: many jobs under one name."""

from typing import Annotated

import typer

from plateau.cli import options as o
from plateau.cli.app import app


@app.command()
def batches(
    limit: Annotated[int, typer.Option(help="Most batches to list.", min=1, max=10_000)] = 20,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """List batches; those with the newest jobs first.

    For example:
      plateau batches
      plateau list --batch walk

    `plateau submit` makes a batch with --each or --parameters, or adds a job to one with --batch.
    """
    from plateau.commands.batches import list_batches as run

    run(limit=limit, url=url, as_json=as_json)


@app.command()
def batch(
    name: Annotated[str, typer.Argument(help="The batch's name.", metavar="NAME")],
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Show the progress of a batch, and whether its frames stop at the same noise.

    For example:
      plateau batch walk

    Frames that stop with different amounts of noise flicker. The lines of the guard say whether all
    jobs stop by the same rule, target, minimum spp and view, and which jobs missed their target.
    """
    from plateau.commands.batches import show as run

    run(name, url=url, as_json=as_json)
