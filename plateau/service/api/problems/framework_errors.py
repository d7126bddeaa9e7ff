"""Starlette's and FastAPI's messages about unreadable bodies, reworded for the sender.

The frameworks' refusals differ by their text only. A test finds texts that are missing here.
"""

from typing import Final

from plateau.farm.wire.examples import NOT_JSON

#: The most files and other parts of a form, and the largest part that is not a file.
MOST_FILES: Final = 2
MOST_FIELDS: Final = 8
MOST_FIELD_BYTES: Final = 1 << 20

_TOO_LONG: Final = (
    f"a part that is not a file has more than {MOST_FIELD_BYTES >> 20} MiB; send the scene as a "
    "file, as curl -F scene=@FILE does"
)

#: Our words, by the beginning of the framework's text.
_WORDS: Final = {
    "Missing boundary": "the header Content-Type has no boundary; leave that header to your HTTP "
    "client, as curl -F does",
    "Invalid multipart data": "the parts of the form cannot be told apart; have your HTTP client "
    "make the multipart/form-data, as curl -F does",
    "The Content-Disposition header field": "a part of the form has no name; name each part, as "
    "curl -F NAME=VALUE does",
    "Too many files": f"the form has more than {MOST_FILES} files; send one scene and one spec",
    "Too many fields": f"the form has more than {MOST_FIELDS} parts; send a scene, or the "
    "scene_sha256 of a stored one, and a spec",
    "Part exceeded": _TOO_LONG,
    "Field exceeded": _TOO_LONG,
    "There was an error parsing the body": NOT_JSON,
}


def in_our_words(said: str) -> str | None:
    """Our words for a framework's text; None for an unknown one."""
    return next((words for begin, words in _WORDS.items() if said.startswith(begin)), None)
