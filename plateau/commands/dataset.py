"""`plateau dataset`: many images of a recipe, in a folder that can be trusted."""

from pathlib import Path
from typing import Annotated

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.commands.printing import print_json
from plateau.errors import tell


@app.command()
def dataset(
    recipe: Annotated[
        Path, typer.Argument(exists=True, dir_okay=False, help="The recipe, a TOML file.")
    ],
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for the images.")
    ] = Path("dataset"),
    url: Annotated[
        str | None,
        typer.Option(help="Render on the service at this URL.", show_default="this machine"),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            help="Workers on this machine, or of the cluster.",
            min=1,
            max=256,
            show_default="one a GPU, or else a core, at most 8",
        ),
    ] = None,
    threads: o.Threads = None,
    on: o.On = None,
    sheet: Annotated[
        bool,
        typer.Option("--sheet", help="Write DIR/sheet.html, with thumbnails."),
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the lines of the manifest, the worst first.")
    ] = False,
) -> None:
    """Render the images of a recipe, each with its error, into one folder.

    For example:
      plateau dataset box.toml -o box
      plateau dataset rooms.toml -o rooms --url http://farm:8713 --sheet
      plateau dataset rooms.toml -o rooms --workers 8 --on "slurm --partition=cpu"

    docs/datasets.md describes recipes. DIR/manifest.jsonl has a line for each image. A run may be
    killed at any moment, and the same command goes on; it refuses a recipe that has changed. The
    exit code is 1 if an image failed, 3 if one missed its target.
    """
    from rich.console import Console

    from plateau.processes.interrupts import Interrupts
    from plateau.rendering.dataset.recipe import Recipe
    from plateau.rendering.dataset.run import exit_code, fill, summary
    from plateau.rendering.mapping import Place
    from plateau.terminal.dataset_progress import dataset_progress_on

    if url is not None and on is not None:
        raise typer.BadParameter("--url is a farm that runs, and --on starts one: choose one")
    asked = Recipe.read(recipe)
    place = Place(farm=url, workers=workers, threads=threads, on=on)
    with Interrupts() as interrupts, dataset_progress_on(Console(stderr=True)) as show:
        lines = fill(asked, out, place, interrupts, show=show, tell=tell)
    if sheet:
        from plateau.rendering.dataset.sheet import write_sheet

        write_sheet(out, lines, asked.layout)
    if as_json:
        print_json(lines)
    else:
        print("\n".join(summary(lines)))
    if interrupts.asked.is_set():
        tell("interrupted; the same command goes on")
        raise typer.Exit(interrupts.exit_code)
    raise typer.Exit(exit_code(lines))
