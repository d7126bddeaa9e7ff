"""`plateau curve | fetch`: the results of a job, running or ended."""

import json
import sys
from pathlib import Path

from rich.console import Console

from plateau.commands.connect import connect
from plateau.commands.outputs import write_results
from plateau.farm.wire import job_text
from plateau.files.out_folder import ready
from plateau.terminal.curve import job_curve


def curve(job_id: str, *, url: str | None, as_csv: bool, as_json: bool) -> None:
    """Print the curve of a job as text, CSV or JSON."""
    with connect(url) as client:
        job_id = client.whole_id(job_id)
        if as_csv:
            print(client.curve_csv(job_id), end="")
            return
        job, points = client.job(job_id), client.curve(job_id)
    if as_json:
        print(json.dumps([point.model_dump(mode="json") for point in points], indent=2))
        return
    if not points:
        print(
            f"the curve has no point yet: the first comes at {job.spec.step:,} spp", file=sys.stderr
        )
        return
    for point in points:
        print(job_text.point_line(job, point))
    console = Console()
    if console.is_terminal and console.encoding.startswith("utf"):
        console.print(job_curve(job, points, columns=console.width, rows=16))


def fetch(job_id: str, out: Path, *, url: str | None, as_json: bool) -> None:
    """Write the results of a job so far into a folder."""
    with connect(url) as client:
        job = client.job(client.whole_id(job_id))
        with ready(out):
            about = write_results(client, job, out)
    if as_json:
        print(json.dumps(about, indent=2))
        return
    for path in about["files"]:
        print(path)
