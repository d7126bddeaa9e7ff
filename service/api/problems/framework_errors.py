"""What Starlette and FastAPI say of a body that they cannot read, in words for its sender.

They tell one refusal from another by their text alone. A test finds texts that have no words here.
"""

from typing import Final

from plateau.farm.wire.examples import NOT_JSON

#: How many files and other parts a form may have, and how large a part may be that is not a file.
MOST_FILES: Final = 2
MOST_FIELDS: Final = 8
MOST_FIELD_BYTES: Final = 1 << 20


_TOO_LONG: Final = (
    f"a part that is not a file has more than {MOST_FIELD_BYTES >> 20} MiB; send the scene as a "
    "file, as curl -F scene=@FILE does"
)

#: How each of their texts begins, and what is said instead.
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
    """What to say instead of a framework's text; None for one that is not known."""
    return next((words for begin, words in _WORDS.items() if said.startswith(begin)), None)
