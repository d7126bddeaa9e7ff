"""What may go wrong with a command: said in one line, without a traceback."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from plateau.farm.bundle import BundleError
from plateau.farm.model.errors import FarmError


class PlateauError(Exception):
    """What went wrong is not the program's fault; the message is all that a user needs."""


class CommandFailed(PlateauError):
    """A command cannot do what was asked; the message says why and what to do."""


class ExtraMissing(PlateauError, ImportError):
    """A package is not installed; the message names the extra that brings it."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(
            f"this needs {package}, which is not installed: pip install 'plateau[{extra}]'"
        )


@contextmanager
def needs(extra: str) -> Iterator[None]:
    """Raise `ExtraMissing` where a package of others cannot be found within.

    Parameters
    ----------
    extra
        The extra of the distribution that brings it, as ``images``.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package in {"", "plateau"}:
            raise
        raise ExtraMissing(package, extra) from error


# No module of weight is imported for this: every process of the farm looks here.
#: Errors whose message is all that a user needs.
EXPECTED: Final = (BundleError, FarmError, OSError, PlateauError)
