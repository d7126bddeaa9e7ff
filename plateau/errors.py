"""Errors, messages and exit codes of commands; a user sees lines without a traceback.

Every process of the farm imports this module, so it imports nothing heavy.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from enum import IntEnum
from typing import Any, Final

from plateau.farm.model.errors import FarmError
from plateau.farm.model.states import JobState


class ExitCode(IntEnum):
    """What a command's exit code means; `plateau --help` lists them."""

    OK = 0  #: success; the job that was waited for converged or reached its limit
    FAILED = 1  #: the command or the job failed; standard error says why
    USAGE = 2  #: the command line is invalid, or two images cannot be compared
    MISSED = 3  #: some jobs of the batch ended before their rule stopped them
    CANCELLED = 4  #: the job, or a job of the batch, was cancelled
    #: This version does not fit the farm's data or its other processes. A restart does not help.
    INCOMPATIBLE = 76
    INTERRUPTED = 130  #: Ctrl-C: 128 + SIGINT, as in shells


#: The exit code for the state in which a job ended.
EXIT_CODES: Final = {
    JobState.CONVERGED: ExitCode.OK,
    JobState.EXHAUSTED: ExitCode.OK,
    JobState.CANCELLED: ExitCode.CANCELLED,
    JobState.FAILED: ExitCode.FAILED,
}


class PlateauError(Exception):
    """The program is not at fault; the message is all that a user needs."""

    def __reduce__(self) -> tuple[Any, ...]:
        # What an error is made of is no longer known, only what became of it.
        return _error, (type(self), self.args, self.__dict__)


def _error(kind: type[PlateauError], args: tuple[Any, ...], state: dict[str, Any]) -> PlateauError:
    """An error as it was when it was pickled."""
    error = kind.__new__(kind)
    error.args = args
    error.__dict__.update(state)
    return error


class CommandFailed(PlateauError):
    """A command cannot do its work; the message says why and what to do."""


class OtherVersion(CommandFailed):
    """The service is not of this version."""


class ExtraMissing(PlateauError, ImportError):
    """A package is not installed; the message names the extra that brings it."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(
            f"this needs {package}, which is not installed: pip install 'plateau[{extra}]'"
        )


def tell(message: str) -> None:
    """Print a message for the user on standard error."""
    print(f"plateau: {message}", file=sys.stderr, flush=True)


@contextmanager
def needs(extra: str) -> Iterator[None]:
    """Raise `ExtraMissing` if the body imports a third-party package that is not installed.

    `extra` names the extra of the distribution that installs the package, such as ``images``.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package in {"", "plateau"}:
            raise
        raise ExtraMissing(package, extra) from error


#: Errors whose message is all that a user needs.
EXPECTED: Final = (FarmError, OSError, PlateauError)
