"""Parts of a spec as a shell writes them, in text: every door takes them.

A value of another kind passes as it is; the fields' own checks then speak of it.
A list becomes a tuple: what passes here is no longer JSON, whose lists a strict check takes.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from pydantic_core.core_schema import no_info_before_validator_function


def named(value: Any) -> Any:
    """A rule, an allocation or a denoiser: ``NAME`` or ``NAME:PARAMETER=VALUE,…``."""
    if not isinstance(value, str):
        return value
    name, _, parameters = value.partition(":")
    return {"name": name, **_definitions(parameters, "NAME or NAME:PARAMETER=VALUE,…", value)}


def _shot(value: Any) -> Any:
    """A shot: ``FPS``, ``FPS:target=JOD`` or ``FPS:target=none``."""
    if not isinstance(value, str):
        return value
    fps, _, parameters = value.partition(":")
    given = _definitions(parameters, form := "FPS or FPS:target=JOD", value)
    if given.keys() - {"target"}:
        raise ValueError(f"takes {form}, not {value!r}")
    if given.get("target") == "none":
        given["target"] = None
    return {"fps": _number(fps), **given}


def _colour(value: Any) -> Any:
    """A colour: ``R,G,B``."""
    if not isinstance(value, str):
        return _tuple(value)
    try:
        red, green, blue = map(float, value.split(","))
    except ValueError:
        raise ValueError(f"takes R,G,B, not {value!r}") from None
    return red, green, blue


def parameters(value: Any) -> Any:
    """The parameters of a scene: ``NAME=VALUE``, or a list of these."""
    texts = [value] if isinstance(value, str) else value
    if not (isinstance(texts, list | tuple) and all(isinstance(one, str) for one in texts)):
        return value
    given = {}
    for text in texts:
        name, separator, of_name = text.partition("=")
        if not (separator and name):
            raise ValueError(f"takes NAME=VALUE, not {text!r}")
        given[name] = of_name
    return given


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _list(value: Any) -> Any:
    """A list, of which a shell's option is one entry."""
    return (value,) if isinstance(value, str) else _tuple(value)


@dataclass(frozen=True)
class _Text:
    """Reads the text form of a field, and names it in the schema of requests."""

    read: Callable[[Any], Any]
    form: str  #: of the text, for people
    is_several: bool = False  #: whether a list of texts is one too
    title: str | None = None  #: of the value that is no text; generated clients name a class so

    def __get_pydantic_core_schema__(self, kind: Any, handler: Any) -> Any:
        return no_info_before_validator_function(self.read, handler(kind))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> Any:
        found = handler(schema)
        if handler.mode == "serialization":
            return found
        if self.title is not None:
            found["title"] = self.title
        text = {"type": "string", "description": f"as text: {self.form}"}
        several = [{**text, "type": "array", "items": {"type": "string"}}] * self.is_several
        return {"anyOf": [*found.pop("anyOf", [found]), text, *several]}


NAMED = _Text(named, "NAME or NAME:PARAMETER=VALUE,…")
SHOT = _Text(_shot, "FPS or FPS:target=JOD")
COLOUR = _Text(_colour, "R,G,B")
PARAMETERS = _Text(parameters, "NAME=VALUE", is_several=True, title="Parameters")
LIST = _Text(_list, "one entry of the list")


def _definitions(text: str, form: str, whole: str) -> dict[str, Any]:
    given: dict[str, Any] = {}
    for definition in filter(None, text.split(",")):
        name, separator, value = definition.partition("=")
        if not (separator and name):
            raise ValueError(f"takes {form}, not {whole!r}")
        given[name] = _number(value)
    return given


def _number(text: str) -> str | int | float:
    """The number, or the truth, that the text stands for; any other text as it is."""
    if text in {"true", "false"}:
        return text == "true"
    for kind in (int, float):
        with suppress(ValueError):
            return kind(text)
    return text
