"""What every command shares: the application, the look of its help, the handling of errors."""

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar, cast

import typer
import typer.core

from plateau.errors import EXPECTED, ExitCode, OtherVersion, needs, tell
from plateau.farm.model.errors import Incompatible

_HELP = """
Render Mitsuba 3 scenes until more samples make no difference that a person could see.

\b
On this machine, without a service:
  plateau render scenes:box -o out
With a service:
  plateau up
  plateau submit scenes:box
  plateau watch ID -o out

\b
Exit codes:
  0    success; the job that was waited for converged or reached its limit
  1    the command or the job failed; standard error says why
  2    the command line is invalid, or `diff` cannot compare the two images
  3    some jobs of the batch ended before their rule stopped them
  4    the job, or a job of the batch, was cancelled
  76   this version does not fit the farm's data or its other processes
  130  interrupted by Ctrl-C (143: by SIGTERM)

Settings are PLATEAU_… environment variables. `plateau doctor` shows them and checks this machine.
"""

#: By the kind of an API problem: the hint of the command line in place of the API's own.
_HINTS: Final = {
    "unknown-job": "`plateau list` shows the jobs",
    "no-image-yet": "`plateau watch` shows when there is one",
    "unknown-scene": "give the file itself; `plateau list scenes` shows what is stored",
    "store-unavailable": "try again shortly; `plateau doctor` may know more",
}

#: The extras of the distribution that a command needs. Commands that need all or none are absent.
_EXTRAS: Final[dict[str, str]] = {
    "api": "service",
    "diff": "images",
    "gc": "farm",
    "judge": "monitor",
    "keys": "farm",
    "monitor": "service",
    "redis-acl": "farm",
    "worker": "worker",
}

_Function = TypeVar("_Function", bound=Callable[..., None])


def _at_home(process: Callable[[Any, Any], Any], ctx: Any, value: Any) -> Any:
    """Read paths that the shell left as they are: quoted ones, and those after a =."""
    from plateau.farm.model.scene_roots import at_home

    return process(ctx, str(at_home(value)) if isinstance(value, str) else value)


class Command(typer.core.TyperCommand):
    """A command whose help keeps the lines of its examples, and whose errors are one line."""

    def __init__(self, *args: Any, help: str = "", **kwargs: Any) -> None:  # noqa: A002
        super().__init__(*args, help=help.replace("For example:", "\b\nFor example:"), **kwargs)
        for one in cast("list[Any]", self.params):
            if one.type_descriptor.annotation is Path:
                setattr(one, "process_value", partial(_at_home, one.process_value))  # noqa: B010
        self._takes_rule = any(one.name == "rule" for one in self.params)
        self._of_rules: list[str] | None = None

    def get_params(self, ctx: Any) -> Any:
        """The options; with --rule also those of the stopping rules."""
        if self._takes_rule and self._of_rules is None:
            from plateau.commands.options import rule_options

            self._of_rules = rule_options.add(self.params)
        return super().get_params(ctx)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the arguments; say what is wrong with a value in plain words."""
        try:
            found: list[str] = super().parse_args(ctx, args)
        except typer.BadParameter as error:
            errors = getattr(error.__cause__, "errors", None)  # of a ValidationError
            if errors is not None:
                from plateau.farm.model import input_errors

                error.message = input_errors.message(errors()[0])
            raise
        return found

    def invoke(self, ctx: Any) -> Any:
        """Run the command; an expected error is one line on standard error and an exit code."""
        try:
            if self._of_rules:
                from plateau.commands.options import rule_options

                rule_options.fold(ctx.params, self._of_rules)
            result = self._run(ctx)
            sys.stdout.flush()
        except KeyboardInterrupt:
            raise typer.Exit(ExitCode.INTERRUPTED) from None
        except BrokenPipeError:  # the reader of our output, such as `head`, has closed it
            raise typer.Exit(ExitCode.FAILED) from None
        except EXPECTED as error:
            tell(_in_words(error))
            misfit = isinstance(error, Incompatible | OtherVersion)
            raise typer.Exit(ExitCode.INCOMPATIBLE if misfit else ExitCode.FAILED) from None
        return result

    def _run(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except ModuleNotFoundError:
            with needs(_EXTRAS.get(ctx.command_path.split()[1], "all")):
                raise


def _in_words(error: BaseException) -> str:
    """The message of an expected error on the command line."""
    if hint := _HINTS.get(getattr(error, "slug", "")):
        return f"{str(error).partition(';')[0]}; {hint}"
    if isinstance(error, OSError) and error.strerror and error.filename is not None:
        return f"{error.filename}: {error.strerror}"  # without the errno
    return str(error)


class _App(typer.Typer):
    """The application, or a group of its commands."""

    def __init__(self, help: str, **options: Any) -> None:  # noqa: A002
        super().__init__(help=help, no_args_is_help=True, rich_markup_mode=None, **options)

    def command(self, name: str | None = None, **options: Any) -> Callable[[_Function], _Function]:
        """Register a function as a command."""
        return super().command(name, cls=Command, **options)


app = _App(
    _HELP,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def group(name: str, about: str, *, extra: str = "all") -> typer.Typer:
    """Register a group of commands: ``plateau NAME COMMAND``.

    `extra` names the extras of the distribution that the commands need.
    """
    made = _App(about)
    _EXTRAS.setdefault(name, extra)
    app.add_typer(made, name=name)
    return made


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
