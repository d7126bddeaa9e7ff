"""Errors and messages of commands, which a user sees as lines without a traceback.

Every process of the farm imports this module, so it imports nothing heavy.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from plateau.farm.model.errors import FarmError


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
