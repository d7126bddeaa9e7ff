"""What a command says of an error that is expected, in one line."""

from typing import Final

from plateau.client import ApiError

#: What the API's own hints are on the command line, by the kind of problem.
_HINTS: Final = {
    "unknown-job": "`plateau list` shows those there are",
    "no-image-yet": "`plateau watch` shows when it comes",
    "unknown-scene": "give the file itself; `plateau scenes` shows what is stored",
    "store-unavailable": "try again shortly; `plateau doctor` may know more",
}


def in_words(error: BaseException) -> str:
    """What a command says of an error that is expected."""
    if isinstance(error, ApiError) and error.slug in _HINTS:
        return f"{str(error).partition(';')[0]}; {_HINTS[error.slug]}"
    if isinstance(error, OSError) and error.strerror and error.filename is not None:
        return f"{error.filename}: {error.strerror}"  # without the number, which is for programs
    return str(error)
