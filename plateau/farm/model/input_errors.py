"""The errors of a user's values in plain English, for API and command line.

Pydantic finds the errors, but its messages speak of inputs, literals and patterns, of which users
know nothing. A message here follows the name of the field: ``step: must be above 0``. None repeats
the value, which may be a secret, to another process.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

#: The tags of a submitted spec's two kinds, with a space so that no field has such a name.
BRANCHES: Final = ("one job", "many jobs")

#: The most characters of a value that a message has.
_SHORT: Final = 60

#: How the message about an unknown rule, allocation or denoiser begins; its names follow.
UNKNOWN_NAME: Final = "must have the name"
#: The message for each pattern; a test finds patterns without one.
PATTERNS: Final = {
    r"^[0-9]{4}-[0-9]{2}-[0-9]{2}"
    r"(T[0-9]{2}:[0-9]{2}(:[0-9]{2})?(Z|[+-][0-9]{2}:[0-9]{2})?)?$": "must be a day or a "
    "time, such as 2026-11-01 or 2026-11-01T12:00Z",
    r"^[0-9a-f]{12}$": "must be an id: 12 characters, each a digit or a letter from a to f",
    r"^([0-9a-f]{64})?$": "must be a SHA-256: 64 characters, each a digit or a letter from a to f",
    r"^[A-Za-z0-9][A-Za-z0-9_.-]*$": "must begin with a letter or a digit, followed by letters, "
    "digits, and the characters _ . -",
    r"^[A-Za-z0-9][A-Za-z0-9_-]{0,31}$": "must begin with a letter or a digit, and have letters, "
    "digits, _ and - only, 32 at most",
    r"^[0-9]{1,15}$": "must be the next_cursor of an earlier page",
    r"^[0-9]{1,19}-[0-9]{1,19}$": "must be the id of an event, such as 1764000000000-0",
    r"^[^\x00-\x1f\x7f]+$": "must not have control characters, such as the end of a line",
}


def message(error: ErrorDetails) -> str:
    """The message for one of the errors that a `ValidationError` lists."""
    words = _WORDS.get(error["type"])
    if isinstance(words, str):
        return words
    if words is not None:
        return words(error.get("ctx", {}))
    said = error["msg"]
    own = said.removeprefix("Value error, ")
    return own if own != said else f"{said[:1].lower()}{said[1:]}"


def by_field(
    details: Iterable[tuple[tuple[int | str, ...], ErrorDetails]], *, with_values: bool = False
) -> dict[str, str]:
    """The message for each wrong field of a spec or a request, by the errors and their places.

    `with_values` has what was given too, except of notices: a caller's own process shows it.
    """
    found: dict[str, list[str]] = {}  # several messages if a field may have several types
    given: dict[str, str] = {}
    for location, one in details:
        field = ".".join(_names(location))
        found.setdefault(field, []).append(message(one))
        if with_values and one["type"] in _WORDS and "notice" not in location:
            given[field] = _given(one)
    return {field: either(messages) + given.get(field, "") for field, messages in found.items()}


def _given(error: ErrorDetails) -> str:
    value = error.get("ctx", {}).get("tag", error["input"])
    is_short = isinstance(value, str | int | float) and len(str(value)) <= _SHORT
    return f", not {value!r}" if is_short and error["type"] != "extra_forbidden" else ""


def _names(location: tuple[int | str, ...]) -> list[str]:
    """The field as the user wrote it, without the branches that the validation tried."""
    names = [str(part) for part in location if part not in BRANCHES]
    if names[:1] == ["parameters"]:
        # The name of one job's parameter; in a list, the entry and the name.
        names = names[: 3 if any(isinstance(part, int) for part in location) else 2]
    if names[:1] in (["rule"], ["allocation"], ["denoise"]):
        names = names[:1] + names[2:]
    if names[:1] == ["watch"]:
        names = names[:2] + names[3:]
    return names


def either(messages: Iterable[str]) -> str:
    """One message from those of a field of several possible types, each once."""
    several = list(dict.fromkeys(messages))
    begin = "must be "
    if len(several) > 1 and all(one.startswith(begin) for one in several):
        kinds = [one.removeprefix(begin) for one in several]
        return f"{begin}{', '.join(kinds[:-1])}, or {kinds[-1]}"
    return "; or ".join(several)


def _number(value: float) -> str:
    return f"{int(value):,}" if value == int(value) else f"{value:g}"


def _bound(words: str, name: str) -> Callable[[Mapping[str, Any]], str]:
    return lambda about: f"must be {words} {_number(about[name])}"


def _alternatives(listed: str) -> str:
    """Pydantic's ``'a', 'b' or 'c'`` without its quotes."""
    return listed.replace("'", "") or "empty"


def _one_of(about: Mapping[str, Any]) -> str:
    return f"must be {_alternatives(about['expected'])}"


def _unknown_tag(about: Mapping[str, Any]) -> str:
    *names, last = _alternatives(about["expected_tags"]).split(", ")
    return f"{UNKNOWN_NAME} {', '.join(names)} or {last}"


def _length(words: str, name: str, one: str, several: str) -> Callable[[Mapping[str, Any]], str]:
    return lambda about: f"must have {words} {about[name]:,} {one if about[name] == 1 else several}"


def _too_short(about: Mapping[str, Any]) -> str:
    if about["min_length"] == 1:
        return "must not be empty"
    return _length("at least", "min_length", "character", "characters")(about)


def _pattern(about: Mapping[str, Any]) -> str:
    return PATTERNS.get(about["pattern"], "is not written as it has to be; /docs says how")


_TEXT: Final = "must be text"
_WHOLE: Final = "must be a whole number"
_NUMBER: Final = "must be a number"
_YES_OR_NO: Final = "must be true or false"
_OBJECT: Final = "must be an object, as {…} in JSON"
_LIST: Final = "must be a list, as […] in JSON"

_WORDS: Final[dict[str, str | Callable[[Mapping[str, Any]], str]]] = {
    "missing": "is missing",
    "extra_forbidden": "there is no such field",
    "greater_than": _bound("above", "gt"),
    "greater_than_equal": _bound("at least", "ge"),
    "less_than": _bound("below", "lt"),
    "less_than_equal": _bound("at most", "le"),
    "finite_number": "must be a finite number",
    "multiple_of": _bound("a multiple of", "multiple_of"),
    "none_required": "must be null",
    "int_type": _WHOLE,
    "int_parsing": _WHOLE,
    "int_from_float": _WHOLE,
    "int_parsing_size": "must be a whole number with fewer digits",
    "float_type": _NUMBER,
    "float_parsing": _NUMBER,
    "bool_type": _YES_OR_NO,
    "bool_parsing": _YES_OR_NO,
    "string_type": _TEXT,
    "string_too_short": _too_short,
    "string_too_long": _length("at most", "max_length", "character", "characters"),
    "string_pattern_mismatch": _pattern,
    "literal_error": _one_of,
    "enum": _one_of,
    "union_tag_invalid": _unknown_tag,
    "union_tag_not_found": lambda about: f"must say its {_alternatives(about['discriminator'])}",
    "dict_type": _OBJECT,
    "model_type": _OBJECT,
    "model_attributes_type": _OBJECT,
    "list_type": _LIST,
    "tuple_type": _LIST,
    "too_long": _length("at most", "max_length", "entry", "entries"),
    "too_short": _length("at least", "min_length", "entry", "entries"),
    "json_invalid": lambda about: f"is not JSON: {about['error']}",
    "json_type": "must be JSON",
    "path_type": "must be a path",
}
