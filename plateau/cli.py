"""The command line: what each command takes and says; what it does is in `plateau.commands`."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
import typer.core

from plateau import options as o
from plateau.exits import ExitCode

# No module of weight is imported here, so that --help and a mistyped option answer at once.

_HELP = """
Render Mitsuba 3 scenes until the eye can no longer tell that samples were added.

\b
On this machine, nothing else needed:
  plateau render scenes/box -o out
As a service, for as many scenes as you like:
  plateau up
  plateau submit scenes/box
  plateau watch ID -o out

\b
Exit codes:
  0    done; a job that was waited for converged, or is exhausted
  1    it could not be done, or the job failed: standard error says why
  2    the command line is not right, or `diff` cannot compare the two images
  4    the job that was waited for was cancelled
  130  interrupted by Ctrl-C (143: by SIGTERM)

Settings are read from PLATEAU_… variables; `plateau doctor` shows them, and what works here.
"""

_Function = TypeVar("_Function", bound=Callable[..., None])


class _Command(typer.core.TyperCommand):
    """Keeps the lines of the examples in a command's help as they are."""

    def __init__(self, *args: Any, help: str = "", **kwargs: Any) -> None:  # noqa: A002
        super().__init__(*args, help=help.replace("For example:", "\b\nFor example:"), **kwargs)


app = typer.Typer(
    help=_HELP,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _command(name: str | None = None) -> Callable[[_Function], _Function]:
    return app.command(name, cls=_Command)


def main() -> None:
    """Run the command line."""
    app(prog_name="plateau")


@contextmanager
def _plain_errors() -> Iterator[None]:
    """Turn what is expected to go wrong into one line on standard error and an exit code."""
    try:
        yield
        sys.stdout.flush()
    except KeyboardInterrupt:
        raise typer.Exit(ExitCode.INTERRUPTED) from None
    except BrokenPipeError:  # whoever read our output has enough, as `head` has
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise typer.Exit(ExitCode.FAILED) from None
    except Exception as error:
        from plateau.errors import EXPECTED

        if not isinstance(error, EXPECTED):
            raise
        print(f"plateau: {error}", file=sys.stderr)
        raise typer.Exit(ExitCode.FAILED) from None


@_command()
@o.takes_spec
def render(
    scene: o.Scene,
    spec: o.Spec,
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Where the results go.")
    ] = Path("plateau-out"),
    workers: Annotated[int, typer.Option(help="Worker processes.", min=1, max=256)] = 1,
    threads: Annotated[
        int | None,
        typer.Option(help="Threads of each worker.", show_default="its share of the cores", min=1),
    ] = None,
    as_json: o.Json = False,
) -> None:
    """Render one scene, here and now, until it has converged.

    For example:
      plateau render scenes/box -o out -D width=512 -D height=512
      plateau render scene.xml --rule fixed --spp 400

    Starts all that it needs, and leaves nothing running. DIR then holds image.exr, image.png,
    difference.png (what differs visibly from the first image), curve.csv, curve.png, summary.txt
    and summary.json. Ctrl-C cancels: what is rendered by then is still written; a second one
    leaves at once.
    """
    from plateau.commands.render import render as run

    with _plain_errors():
        raise typer.Exit(run(scene, out, spec, workers=workers, threads=threads, as_json=as_json))


_Host = Annotated[str, typer.Option(help="Address to listen on; this machine's own only.")]
_Port = Annotated[
    int, typer.Option(help="Port to listen on; 0 takes a free one.", min=0, max=65535)
]


@_command()
def up(
    workers: Annotated[int, typer.Option(help="Worker processes.", min=0, max=256)] = 1,
    host: _Host = "127.0.0.1",
    port: _Port = 8713,
) -> None:
    """Run the whole service on this machine until Ctrl-C.

    For example:
      plateau up --workers 2

    API, monitor, workers and an embedded Redis; its data folder survives a restart, and jobs
    go on where they were. With PLATEAU_REDIS_URL or PLATEAU_BLOBS set, those are used instead.
    """
    from plateau.commands.serve import up as run

    with _plain_errors():
        raise typer.Exit(run(workers=workers, host=host, port=port))


@_command()
def api(
    host: _Host = "127.0.0.1",
    port: _Port = 8713,
    ready_fd: Annotated[int | None, typer.Option(hidden=True)] = None,
) -> None:
    """Run one API process.

    For example:
      PLATEAU_REDIS_URL=redis://10.0.0.5 PLATEAU_BLOBS=s3://farm/plateau plateau api
    """
    from plateau.commands.serve import api as run

    with _plain_errors():
        run(host=host, port=port, ready_fd=ready_fd)


@_command()
def monitor() -> None:
    """Run one monitor: it merges slices, judges the image, and ends jobs.

    For example:
      PLATEAU_REDIS_URL=redis://10.0.0.5 PLATEAU_BLOBS=s3://farm/plateau plateau monitor

    Any number may run; when one dies, another takes its jobs over.
    """
    from plateau.commands.serve import monitor as run

    with _plain_errors():
        run()


@_command()
def worker() -> None:
    """Run one worker: it renders slices of any job.

    For example:
      PLATEAU_REDIS_URL=redis://10.0.0.5 PLATEAU_BLOBS=s3://farm/plateau plateau worker

    PLATEAU_THREADS limits its threads. It may be stopped, or die, at any time.
    """
    from plateau.commands.serve import worker as run

    with _plain_errors():
        run()


@_command()
@o.takes_spec
def submit(
    scene: o.Scene,
    spec: o.Spec,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Submit a scene to a running service; prints the new job's id.

    For example:
      plateau submit scenes/box --max-spp 2000 --batch tuesday
      plateau watch $(plateau submit scene.zip -D width=512) -o out
    """
    from plateau.commands.jobs import submit as run

    with _plain_errors():
        run(scene, spec, url=url, as_json=as_json)


@_command()
def watch(
    job_id: o.JobId,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="DIR", help="Write the results there.")
    ] = None,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Watch a job until it is finished; the exit code says how it ended.

    For example:
      plateau watch 3f9ac2d01b77 -o out

    Ctrl-C stops watching; the job goes on.
    """
    from plateau.commands.jobs import watch as run

    with _plain_errors():
        raise typer.Exit(run(job_id, out, url=url, as_json=as_json))


@_command()
def show(job_id: o.JobId, url: o.Url = None, as_json: o.Json = False) -> None:
    """Show a job: where it stands and why, its story, and where its images are.

    For example:
      plateau show 3f9ac2d01b77
    """
    from plateau.commands.jobs import show as run

    with _plain_errors():
        run(job_id, url=url, as_json=as_json)


@_command("list")
def list_jobs(
    state: Annotated[
        str | None, typer.Option(help="Only jobs in this state, such as rendering.")
    ] = None,
    batch: Annotated[str | None, typer.Option(help="Only jobs of this batch.")] = None,
    limit: Annotated[int, typer.Option(help="Most jobs to list.", min=1, max=10_000)] = 20,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """List jobs, newest first.

    For example:
      plateau list --state rendering
    """
    from plateau.commands.jobs import list_jobs as run

    with _plain_errors():
        run(state=state, batch=batch, limit=limit, url=url, as_json=as_json)


@_command()
def cancel(job_id: o.JobId, url: o.Url = None, as_json: o.Json = False) -> None:
    """Cancel a job; what is merged by then is kept as its image.

    For example:
      plateau cancel 3f9ac2d01b77
    """
    from plateau.commands.jobs import cancel as run

    with _plain_errors():
        run(job_id, url=url, as_json=as_json)


@_command()
def diff(
    reference: Annotated[Path, typer.Argument(help="A PNG or EXR file.")],
    test: Annotated[Path, typer.Argument(help="Another, of the same kind and size.")],
    field_of_view: Annotated[
        float, typer.Option(help="Angle that the image's width fills, in degrees.")
    ] = 45.0,
    white_luminance: Annotated[
        float, typer.Option(help="The display's white in cd/m².", max=20_000)
    ] = 100.0,
    gamma: Annotated[
        float | None,
        typer.Option(
            help="Power from the files' values to linear light.",
            show_default="2.2 for PNG, 1 for EXR",
        ),
    ] = None,
    primaries: Annotated[str, typer.Option(help="The display's: rec709 or adobe1998.")] = "rec709",
    exposure: Annotated[float, typer.Option(help="Exposure in EV.")] = 0.0,
    luminance_only: Annotated[
        bool, typer.Option("--luminance-only", help="Leave differences in colour out.")
    ] = False,
    map_file: Annotated[
        Path | None,
        typer.Option("--map", metavar="OUT.png", help="Mark the visible pixels on TEST, there."),
    ] = None,
    as_json: o.Json = False,
) -> None:
    """Count the pixels by which an eye can tell two images apart.

    For example:
      plateau diff before.png after.png --map difference.png
      plateau diff reference.exr test.exr --exposure 1 --json

    The exit code is 0 whatever the count, and 2 where the images cannot be compared.
    """
    from plateau.commands.diff import diff as run

    with _plain_errors():
        code = run(
            reference,
            test,
            field_of_view_deg=field_of_view,
            white_luminance=white_luminance,
            gamma=gamma,
            primaries=primaries,
            exposure_ev=exposure,
            luminance_only=luminance_only,
            map_file=map_file,
            as_json=as_json,
        )
    raise typer.Exit(code)


@_command()
@o.takes_spec
def judge(
    folder: Annotated[Path, typer.Argument(help="Slices that a job kept, or EXR images.")],
    spec: o.Spec,
    cumulative: Annotated[
        bool, typer.Option("--cumulative", help="Each image contains the one before.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="DIR", help="Write the curve there.")
    ] = None,
    as_json: o.Json = False,
) -> None:
    """Judge images that are rendered already, and say where each rule would have stopped.

    FOLDER holds the slices that a job kept (--keep-slices), or EXR images of any renderer, each
    of --slice-spp samples per pixel, in the order of their names.

    For example:
      plateau judge out/slices --rule visible --watch reverse --watch myszkowski -o judged
      plateau judge frames --slice-spp 20 --step 40 --white-luminance 300
    """
    from plateau.commands.judge import judge as run

    with _plain_errors():
        raise typer.Exit(run(folder, spec, cumulative=cumulative, out=out, as_json=as_json))


study = typer.Typer(help="Observer studies.", no_args_is_help=True, rich_markup_mode=None)
app.add_typer(study, name="study")


@study.command("fit", cls=_Command)
def study_fit(
    table: Annotated[Path, typer.Argument(help="A CSV file in the form of the paper's table 1.")],
    plot: Annotated[
        Path | None, typer.Option(metavar="OUT.png", help="Plot answers and fits, there.")
    ] = None,
    as_json: o.Json = False,
) -> None:
    """Fit the probability to perceive a difference, for each scene of a study.

    TABLE has a column "scene", then one for each number of samples per pixel that was shown, with
    the share of the observers that saw a difference.

    For example:
      plateau study fit answers.csv --plot answers.png
    """
    from plateau.commands.study import fit

    with _plain_errors():
        raise typer.Exit(fit(table, plot=plot, as_json=as_json))


@_command()
def doctor(as_json: o.Json = False) -> None:
    """Check what works on this machine, and say why what does not.

    For example:
      plateau doctor

    The exit code is 1 where nothing could be rendered.
    """
    from plateau.commands.doctor import doctor as run

    with _plain_errors():
        raise typer.Exit(run(as_json=as_json))
