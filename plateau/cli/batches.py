"""Commands for batches: many jobs under one name."""

from pathlib import Path
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
    """Show the progress of a batch.

    For example:
      plateau batch walk
    """
    from plateau.commands.batches import show as run

    run(name, url=url, as_json=as_json)


@app.command()
def shot(
    name: Annotated[str, typer.Argument(help="The batch's name.", metavar="NAME")],
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Show how good the frames of a batch are as a shot, and what each was given.

    For example:
      plateau shot walk

    A shot is a batch that was submitted with --shot. Its quality is that of the video against the
    converged one, in JOD: 10 is the best, and at 9 three of four people prefer the converged one. A
    frame waits once its own rule is satisfied.
    """
    from plateau.commands.shots import show as run

    run(name, url=url, as_json=as_json)


@app.command()
def movie(
    name: Annotated[str, typer.Argument(help="The batch's name.", metavar="NAME")],
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", metavar="FILE", help="The movie: .mp4 or .mov (H.264), or .webm (VP9)."
        ),
    ],
    fps: Annotated[
        str, typer.Option(metavar="RATE", help="Frames per second, such as 29.97 or 30000/1001.")
    ] = "24",
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Write the pictures of a batch as a movie.

    For example:
      plateau movie walk -o walk.mp4
      plateau watch --batch walk && plateau movie walk -o walk.webm --fps 30

    Frames play by the parameter that tells them apart, if it is a number, or else as they were
    submitted; of a frame that was rendered again the newest job counts. While a batch is rendered,
    its frames are as they are now, and the one before stands in for a frame without an image.
    """
    from plateau.commands.movie import movie as run

    run(name, out, rate=fps, url=url, as_json=as_json)
