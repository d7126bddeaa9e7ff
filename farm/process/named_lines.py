"""Files in which the operator gives names to things that users may only name."""

from collections.abc import Callable
from pathlib import Path
from typing import Final, TypeVar

from pydantic import TypeAdapter, ValidationError

from plateau.farm.model.place_names import PlaceName

_NAME: Final = TypeAdapter(PlaceName)

Thing = TypeVar("Thing")


def read_named_lines(
    path: Path, parse: Callable[[str], Thing | None], what: str
) -> dict[str, Thing]:
    """The things of a file by their names; blank lines and those that begin with # do not count.

    Parameters
    ----------
    path
        The file: on each line a name, a blank and a text.
    parse
        Makes a thing of a text; None where it cannot.
    what
        A text has to be, in words.

    Raises
    ------
    ValueError
        The file cannot be read, or a line is wrong; the message shows no text of it.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} cannot be read: {error}") from None
    found: dict[str, Thing] = {}
    for number, line in enumerate(map(str.strip, lines), 1):
        if not line or line.startswith("#"):
            continue
        name, _, text = line.partition(" ")
        thing = parse(text.strip())
        if not _is_name(name) or thing is None or name in found:
            raise ValueError(f"line {number} of {path} must be a new name, a blank and {what}")
        found[name] = thing
    return found


def _is_name(text: str) -> bool:
    try:
        _NAME.validate_python(text)
    except ValidationError:
        return False
    return True
