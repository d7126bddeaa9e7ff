"""Arguments and options that several commands share."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from plateau import scenes
from plateau.commands.options import complete


def _scene(given: Path) -> Path:
    """Return the path of a scene, which may be an example scene, such as `scenes:box`."""
    try:
        return scenes.path_of(given)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None


Scene = Annotated[
    Path,
    typer.Argument(
        callback=_scene,
        help="A Mitsuba XML, an analytic scene (JSON), a file of another renderer, a zip, a folder "
        "with one of them, or an example scene: scenes:NAME, where NAME is "
        f"{', '.join(scenes.NAMES)}. A service also takes one where it lies: {{ROOT}}/PATH, in a "
        "scene root.",
    ),
]
_job_id = partial(
    typer.Argument,
    help="The job's id, or an unambiguous prefix of it.",
    autocompletion=complete.job_ids,
)
JobId = Annotated[str, _job_id(metavar="ID")]
#: A command takes either a job or a batch; `one_of` checks that.
OrJobId = Annotated[str | None, _job_id(metavar="[ID]")]
OrBatch = Annotated[
    str | None,
    typer.Option("--batch", metavar="NAME", help="All jobs of this batch instead of one job."),
]
Url = Annotated[
    str | None,
    typer.Option(
        "--url",
        envvar="PLATEAU_URL",
        help="URL of the service.",
        show_default="http://127.0.0.1:8713",
    ),
]
FieldOfView = Annotated[
    float | None,
    typer.Option(
        help="Angle that the image's width covers, in degrees, in place of pixels per degree.",
        show_default="none",
    ),
]
PixelsPerDegree = Annotated[
    float | None,
    typer.Option(help="Pixels in a degree at the image's centre.", show_default="20"),
]
WhiteLuminance = Annotated[
    float | None, typer.Option(help="White of the display in cd/m².", show_default="200")
]
Seen = Annotated[
    str | None,
    typer.Option(
        metavar="PLACE",
        help="Where the image is seen: screen (a desk monitor at 200 %); desk, phone or cinema, "
        "pixel by pixel; or paper (45° of a screen). Sets pixels per degree, white, contrast and "
        "light on the display; the options of these count before it.",
        show_default="screen",
        autocompletion=complete.places,
    ),
]
Threads = Annotated[
    int | None,
    typer.Option(help="Threads of each worker.", show_default="its share of the cores", min=1),
]
On = Annotated[
    str | None,
    typer.Option(
        metavar="ENGINE",
        help="A cluster whose nodes are to have the workers, with its own options: "
        "'slurm --partition=cpu --time=2:00:00', as sbatch has them, or 'ray --num-gpus=1'.",
        show_default="this machine",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON, for scripts.")]
NoCurve = Annotated[bool, typer.Option("--no-curve", help="Show progress without the curve.")]


def one_of(job_id: str | None, batch: str | None) -> str:
    """The job's id, or "" if a batch is named; refuses a command line with neither or both."""
    if (job_id is None) == (batch is None):
        raise typer.BadParameter("give the id of a job, or --batch NAME")
    return job_id or ""
