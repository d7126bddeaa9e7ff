"""What every command shares: the application, how help looks, and what becomes of an error."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any, TypeVar

import typer
import typer.core

from plateau.exit_codes import ExitCode

_HELP = """
Render Mitsuba 3 scenes until the eye can no longer tell that samples were added.

\b
On this machine, nothing else needed:
  plateau render scenes:box -o out
As a service, for as many scenes as you like:
  plateau up
  plateau submit scenes:box
  plateau watch ID -o out

\b
Exit codes:
  0    done; a job that was waited for converged, or is exhausted
  1    it could not be done, or the job failed: standard error says why
  2    the command line is not right, or `diff` cannot compare the two images
  3    of the batch that was waited for, jobs ended before their rule stopped them
  4    the job that was waited for was cancelled, or one of the batch
  76   a process does not fit the farm's data, or its other processes: install another version
  130  interrupted by Ctrl-C (143: by SIGTERM)

Settings are read from PLATEAU_… variables; `plateau doctor` shows them, and what works here.
"""

_Function = TypeVar("_Function", bound=Callable[..., None])


class Command(typer.core.TyperCommand):
    """Keeps the lines of the examples in a command's help as they are."""

    def __init__(self, *args: Any, help: str = "", **kwargs: Any) -> None:  # noqa: A002
        super().__init__(*args, help=help.replace("For example:", "\b\nFor example:"), **kwargs)


app = typer.Typer(
    help=_HELP,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from plateau.farm.model.versions import plateau

        print(f"plateau {plateau()}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    pass


def command(
    name: str | None = None, *, takes_negative_numbers: bool = False
) -> Callable[[_Function], _Function]:
    """Register a function as a command of `plateau`.

    Where it takes negative numbers, ``-5`` is one of its arguments and not an unknown option.
    """
    return app.command(
        name, cls=Command, context_settings={"ignore_unknown_options": takes_negative_numbers}
    )


@contextmanager
def plain_errors() -> Iterator[None]:
    """Turn what is expected to go wrong into one line on standard error and an exit code."""
    try:
        yield
        sys.stdout.flush()
    except KeyboardInterrupt:
        raise typer.Exit(ExitCode.INTERRUPTED) from None
    except BrokenPipeError:  # whoever read our output has enough, as `head` has
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise typer.Exit(ExitCode.FAILED) from None
    except typer.Exit:  # an exit code, not an error
        raise
    except Exception as error:
        from plateau.cli.error_text import in_words
        from plateau.errors import EXPECTED
        from plateau.farm.model.errors import Incompatible

        if not isinstance(error, EXPECTED):
            raise
        print(f"plateau: {in_words(error)}", file=sys.stderr)
        fits = not isinstance(error, Incompatible)
        raise typer.Exit(ExitCode.FAILED if fits else ExitCode.INCOMPATIBLE) from None
