"""`plateau fetch`: the results of a job, running or ended."""

from pathlib import Path
from typing import Annotated

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.commands.connect import connect
from plateau.commands.printing import print_json


@app.command()
def fetch(
    job_id: o.JobId,
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for the files.")
    ] = Path("plateau-out"),
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Fetch the images, the curve and a summary of a job, running or ended.

    For example:
      plateau fetch 3f9ac2d01b77 -o out

    Writes what `plateau render` does, and prints the names of the files. Kept slices are fetched
    too, except those already in DIR. Files of another job in DIR are removed; other files are not.
    --json prints the summary. Over HTTP, GET /v1/jobs/ID/results.zip has all but slices in one
    file.
    """
    from plateau.files.out_folder import ready
    from plateau.rendering.outputs import write_results

    with connect(url) as client:
        job = client.job(client.whole_id(job_id))
        with ready(out):
            about = write_results(client, job, out)
    if as_json:
        print_json(about)
    else:
        print("\n".join(about["files"]))
