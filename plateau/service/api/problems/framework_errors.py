"""Starlette's and FastAPI's messages about unreadable bodies, reworded for the sender.

The frameworks' refusals differ by their text only. A test finds texts that are missing here.
"""

from typing import Final

from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.problem import Problem, ProblemType

#: The most files and other parts of a form, and the largest part that is not a file.
MOST_FILES: Final = 2
MOST_FIELDS: Final = 8
MOST_FIELD_BYTES: Final = 1 << 20

#: Our problems, by the beginning of the framework's text.
_KINDS: Final[dict[str, ProblemType]] = {
    "Missing boundary": problems.NO_BOUNDARY,
    "Invalid multipart data": problems.BROKEN_FORM,
    "The Content-Disposition header field": problems.NAMELESS_PART,
    "Too many files": problems.TOO_MANY_FILES,
    "Too many fields": problems.TOO_MANY_PARTS,
    "Part exceeded": problems.LARGE_PART,
    "Field exceeded": problems.LARGE_PART,
    "There was an error parsing the body": problems.MALFORMED_REQUEST,
}


def in_our_words(said: str) -> Problem | None:
    """Our problem for a framework's text; None for an unknown one."""
    kind = next((kind for begin, kind in _KINDS.items() if said.startswith(begin)), None)
    if kind is None:
        return None
    return Problem(kind, files=MOST_FILES, parts=MOST_FIELDS, mib=MOST_FIELD_BYTES >> 20)
