"""What may go wrong with a command: said in one line, without a traceback."""

from typing import Final

from farm.bundle import BundleError
from farm.errors import FarmError


class PlateauError(Exception):
    """What went wrong is not the program's fault; the message is all that a user needs."""


class CommandFailed(PlateauError):
    """A command cannot do what was asked; the message says why and what to do."""


# No module of weight is imported for this: every process of the farm looks here.
#: Errors whose message is all that a user needs.
EXPECTED: Final = (BundleError, FarmError, OSError, PlateauError)

#: What the API's own hints are on the command line, by the kind of problem.
_HINTS: Final = {
    "unknown-job": "`plateau list` shows those there are",
    "no-image-yet": "`plateau watch` shows when it comes",
    "unknown-scene": "give the file itself; `plateau scenes` shows what is stored",
    "store-unavailable": "try again shortly; `plateau doctor` may know more",
}


def in_words(error: BaseException) -> str:
    """What a command says of an error that is expected."""
    from plateau.client import ApiError

    if isinstance(error, ApiError) and error.slug in _HINTS:
        return f"{str(error).partition(';')[0]}; {_HINTS[error.slug]}"
    if isinstance(error, OSError) and error.strerror and error.filename is not None:
        return f"{error.filename}: {error.strerror}"  # without the number, which is for programs
    return str(error)
